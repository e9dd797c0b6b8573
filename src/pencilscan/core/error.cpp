#include "pencilscan/core/error.h"

#include <utility>

namespace pencilscan {
namespace {

std::string message(const std::string& path, const std::string& field, const std::string& value,
                    const std::string& rule) {
  std::string text = path;
  if (!field.empty()) text += ": " + field;
  if (!value.empty()) text += " = " + value;
  return text + ": " + rule;
}

}  // namespace

InputError::InputError(std::string path_, std::string field_, std::string value_, std::string rule_)
    : std::runtime_error(message(path_, field_, value_, rule_)),
      path(std::move(path_)),
      field(std::move(field_)),
      value(std::move(value_)),
      rule(std::move(rule_)) {}

}  // namespace pencilscan
