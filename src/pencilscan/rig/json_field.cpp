#include "pencilscan/rig/json_field.h"

#include <algorithm>
#include <cmath>
#include <nlohmann/json.hpp>

#include "pencilscan/core/error.h"

namespace pencilscan {
namespace {

constexpr std::size_t kLongestShownValue = 60;

std::string shown(const nlohmann::json& value) {
  std::string text = value.dump(-1, ' ', false, nlohmann::json::error_handler_t::replace);
  if (text.size() > kLongestShownValue) text = text.substr(0, kLongestShownValue) + "...";
  return text;
}

bool contains(const std::vector<const char*>& keys, const std::string& key) {
  return std::any_of(keys.begin(), keys.end(), [&](const char* known) { return key == known; });
}

}  // namespace

void JsonField::fail(const std::string& rule) const {
  throw InputError(path_, field_, shown(*value_), rule);
}

std::string JsonField::child(const std::string& key) const {
  return field_.empty() ? key : field_ + "." + key;
}

bool JsonField::has(const char* key) const { return value_->contains(key); }

bool JsonField::is_object() const { return value_->is_object(); }

bool JsonField::is_array() const { return value_->is_array(); }

void JsonField::check_keys(std::initializer_list<const char*> required,
                           std::initializer_list<const char*> optional) const {
  check_keys(std::vector<const char*>(required), std::vector<const char*>(optional));
}

void JsonField::check_keys(const std::vector<const char*>& required,
                           const std::vector<const char*>& optional) const {
  if (!value_->is_object()) fail("must be an object");
  for (const auto& [key, value] : value_->items()) {
    if (!contains(required, key) && !contains(optional, key)) {
      throw InputError(path_, child(key), shown(value), "unknown key");
    }
  }
  for (const char* key : required) {
    if (!has(key)) throw InputError(path_, child(key), "", "this key is missing");
  }
}

JsonField JsonField::at(const std::string& key) const {
  if (!value_->contains(key)) throw InputError(path_, child(key), "", "this key is missing");
  return {path_, child(key), (*value_)[key]};
}

std::vector<std::pair<std::string, JsonField>> JsonField::members() const {
  if (!value_->is_object()) fail("must be an object");
  std::vector<std::pair<std::string, JsonField>> members;
  for (const auto& [key, value] : value_->items()) {
    members.emplace_back(key, JsonField(path_, child(key), value));
  }
  return members;
}

std::vector<JsonField> JsonField::entries() const {
  if (!value_->is_array()) fail("must be a list");
  std::vector<JsonField> entries;
  for (std::size_t i = 0; i < value_->size(); ++i) {
    entries.push_back(JsonField(path_, field_ + "[" + std::to_string(i) + "]", (*value_)[i]));
  }
  return entries;
}

std::vector<JsonField> JsonField::entries(std::size_t count) const {
  if (!value_->is_array() || value_->size() != count) {
    fail("must be a list of " + std::to_string(count));
  }
  return entries();
}

double JsonField::number() const {
  if (!value_->is_number()) fail("must be a number");
  const double number = value_->get<double>();
  if (!std::isfinite(number)) fail("must be finite");
  return number;
}

double JsonField::positive() const {
  const double value = number();
  if (!(value > 0)) fail("must be > 0");
  return value;
}

int JsonField::integer(int low, int high) const {
  const double value = number();
  if (value != std::floor(value) || value < low || value > high) {
    fail("must be an integer from " + std::to_string(low) + " to " + std::to_string(high));
  }
  return static_cast<int>(value);
}

std::string JsonField::text() const {
  if (!value_->is_string()) fail("must be a string");
  return value_->get<std::string>();
}

Vec3 JsonField::vector3() const {
  const auto numbers = entries(3);
  return {numbers[0].number(), numbers[1].number(), numbers[2].number()};
}

Mat3 JsonField::matrix3() const {
  Mat3 matrix;
  const auto rows = entries(3);
  for (int row = 0; row < 3; ++row) {
    matrix.row(row) = rows[static_cast<std::size_t>(row)].vector3().transpose();
  }
  return matrix;
}

}  // namespace pencilscan
