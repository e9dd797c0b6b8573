#include "pencilscan/recording/frame_folders.h"

#include <algorithm>
#include <cstdio>
#include <utility>

#include "pencilscan/core/error.h"
#include "pencilscan/io/found_files.h"
#include "pencilscan/io/image.h"

namespace pencilscan {
namespace {

bool is_number(const std::string& name) {
  return std::all_of(name.begin(), name.end(), [](char c) { return c >= '0' && c <= '9'; });
}

bool is_six_digits(const std::string& name) { return name.size() == 6 && is_number(name); }

std::string without_leading_zeros(const std::string& digits) {
  return digits.substr(std::min(digits.find_first_not_of('0'), digits.size()));
}

/// Order of whole numbers of any length, and by name where they are equal (1, 01).
bool is_less_by_number(const std::string& a, const std::string& b) {
  const std::string x = without_leading_zeros(a);
  const std::string y = without_leading_zeros(b);
  if (x.size() != y.size()) return x.size() < y.size();
  return x == y ? a < b : x < y;
}

/// The numbers in two names at the first place where the names differ; empty: there is none.
std::pair<std::string, std::string> first_other_numbers(const std::string& a,
                                                        const std::string& b) {
  const auto is_digit = [](char c) { return c >= '0' && c <= '9'; };
  const auto differs = std::mismatch(a.begin(), a.end(), b.begin(), b.end()).first;
  std::size_t begin = static_cast<std::size_t>(differs - a.begin());
  while (begin > 0 && is_digit(a[begin - 1])) --begin;
  const auto number = [&](const std::string& name) {
    const auto from = name.begin() + static_cast<std::ptrdiff_t>(begin);
    return std::string(from, std::find_if_not(from, name.end(), is_digit));
  };
  return {number(a), number(b)};
}

}  // namespace

std::vector<std::string> frame_folder_names(const std::filesystem::path& folder) {
  if (!std::filesystem::is_directory(folder))
    throw InputError(folder.string(), "", "", "must be a folder that holds frame folders");
  std::vector<std::string> names;
  for (const auto& entry : std::filesystem::directory_iterator(folder)) {
    std::string name = entry.path().filename().string();
    if (entry.is_directory() && !name.starts_with('.')) names.push_back(std::move(name));
  }
  if (names.empty()) {
    throw InputError(folder.string(), "frame folders", "none",
                     "must hold at least one frame folder such as 000000; " + holdings(folder));
  }
  if (std::all_of(names.begin(), names.end(), is_number))
    std::sort(names.begin(), names.end(), is_less_by_number);
  else
    std::sort(names.begin(), names.end());
  return names;
}

std::string six_digits(std::size_t frame) {
  char name[24];
  std::snprintf(name, sizeof name, "%06zu", frame);
  return name;
}

std::optional<std::string> order_warning(std::span<const std::string> names) {
  for (std::size_t i = 1; i < names.size(); ++i) {
    const auto [before, after] = first_other_numbers(names[i - 1], names[i]);
    if (before.empty() || after.empty() || !is_less_by_number(after, before)) continue;
    if (std::all_of(names.begin(), names.end(), is_number)) continue;
    return "frames are taken in the order of their names, in which " + names[i - 1] +
           " comes before " + names[i] +
           ": where their numbers count, give all as many digits, or name them by digits alone";
  }
  return std::nullopt;
}

FoundFrames find_pictures(const std::filesystem::path& folder) {
  const std::vector<std::string> names = frame_folder_names(folder);
  const bool numbered = std::all_of(names.begin(), names.end(), is_six_digits);
  FoundFrames found;
  for (std::size_t i = 0; i < names.size(); ++i) {
    const std::size_t row = numbered ? std::stoul(names[i]) : i;
    bool any = false;
    for (const auto& entry : std::filesystem::directory_iterator(folder / names[i])) {
      const std::string camera = entry.path().stem().string();
      const auto file = find_image(folder / names[i], camera);
      if (!file || *file != entry.path()) continue;
      found.cameras[camera][row] = *file;
      any = true;
    }
    if (!any) {
      found.without_picture.push_back(names[i]);
      continue;
    }
    found.names.resize(row + 1);
    found.names[row] = names[i];
  }
  if (found.cameras.empty()) {
    throw InputError(folder.string(), "images", "none",
                     "must hold images such as " + names.front() + "/cam0.png; of " +
                         names.front() + ", " + holdings(folder / names.front()));
  }
  return found;
}

}  // namespace pencilscan
