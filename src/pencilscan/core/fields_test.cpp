#include "pencilscan/core/fields.h"

#include <gtest/gtest.h>

namespace pencilscan {
namespace {

enum class Kind { kOne, kOther };

struct Inner {
  double length = 0.1;
  std::array<int, 2> pair = {1, 2};
  std::string name = "a";
};

struct Outer {
  bool is_on = true;
  Kind kind = Kind::kOne;
  Inner inner;
  std::variant<Inner, float> choice;
  std::vector<std::string> names;
  std::optional<int> number;
  std::function<void()> work;
};

TEST(Fields, AreAllListedInOrder) {
  EXPECT_EQ(fields_text(Outer{}), R"({yes 0 {0.1 [1 2 ]"a"}0:{0.1 [1 2 ]"a"}[]-none})");
}

TEST(Fields, EveryOneOfThemChangesTheText) {
  const std::string plain = fields_text(Outer{});
  std::vector<Outer> changed(9);
  changed[0].is_on = false;
  changed[1].kind = Kind::kOther;
  changed[2].inner.length = 0.1 + 1e-15;
  changed[3].inner.pair[1] = 3;
  changed[4].inner.name = "b";
  changed[5].choice = 0.1F;
  changed[6].names = {""};
  changed[7].number = 0;
  changed[8].work = [] {};
  for (const Outer& value : changed) EXPECT_NE(fields_text(value), plain);
}

}  // namespace
}  // namespace pencilscan
