#pragma once

#include <initializer_list>
#include <nlohmann/json_fwd.hpp>
#include <string>
#include <vector>

#include "pencilscan/geometry/types.h"

namespace pencilscan {

/// One value inside a JSON file together with its place, such as `cameras[2].K[0][0]`, so that
/// every complaint names file, field, value and rule. All readers throw InputError.
class JsonField {
 public:
  JsonField(std::string path, const nlohmann::json& value)
      : path_(std::move(path)), value_(&value) {}

  [[noreturn]] void fail(const std::string& rule) const;

  /// An object whose keys all are known and which has the required ones.
  void check_keys(std::initializer_list<const char*> required,
                  std::initializer_list<const char*> optional) const;
  void check_keys(const std::vector<const char*>& required,
                  const std::vector<const char*>& optional) const;
  [[nodiscard]] bool has(const char* key) const;
  [[nodiscard]] bool is_object() const;
  [[nodiscard]] bool is_array() const;
  [[nodiscard]] JsonField at(const std::string& key) const;
  /// The members of an object as (key, field).
  [[nodiscard]] std::vector<std::pair<std::string, JsonField>> members() const;
  /// The entries of a list.
  [[nodiscard]] std::vector<JsonField> entries() const;
  /// The entries of a list of exactly `count`.
  [[nodiscard]] std::vector<JsonField> entries(std::size_t count) const;

  [[nodiscard]] double number() const;    ///< finite
  [[nodiscard]] double positive() const;  ///< finite, > 0
  [[nodiscard]] int integer(int low, int high) const;
  [[nodiscard]] std::string text() const;
  [[nodiscard]] Vec3 vector3() const;
  [[nodiscard]] Mat3 matrix3() const;

 private:
  JsonField(std::string path, std::string field, const nlohmann::json& value)
      : path_(std::move(path)), field_(std::move(field)), value_(&value) {}
  [[nodiscard]] std::string child(const std::string& key) const;

  std::string path_;
  std::string field_;
  const nlohmann::json* value_;
};

}  // namespace pencilscan
