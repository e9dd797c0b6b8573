#include "pencilscan/io/polygon_mesh.h"

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <sstream>
#include <vector>

#include "pencilscan/core/byte_order_mark.h"
#include "pencilscan/core/error.h"
#include "pencilscan/io/file.h"
#include "pencilscan/io/triangulated_polygon.h"

namespace pencilscan {
namespace {

/// The lines of an OFF that say something, as words.
class OffLines {
 public:
  explicit OffLines(const std::filesystem::path& path)
      : path_(path.string()), text_(without_byte_order_mark(read_file(path))) {}

  [[noreturn]] void fail(const std::string& value, const std::string& rule) const {
    throw InputError(path_, "line " + std::to_string(number_), value, rule);
  }
  [[nodiscard]] std::string field() const { return "line " + std::to_string(number_); }

  /// The next line that holds more than a comment. InputError at the end of the file.
  std::vector<std::string> next() {
    for (std::string line; std::getline(text_, line);) {
      ++number_;
      std::istringstream words(line.substr(0, line.find('#')));
      std::vector<std::string> found;
      for (std::string word; words >> word;) found.push_back(word);
      if (!found.empty()) return found;
    }
    throw InputError(path_, "", "", "truncated OFF: it is shorter than its header says");
  }

  [[nodiscard]] double number(const std::string& word) const {
    char* end = nullptr;
    const double value = std::strtod(word.c_str(), &end);
    if (!std::isfinite(value) || *end != '\0') fail(word, "must be a finite number");
    return value;
  }
  [[nodiscard]] std::size_t count(const std::string& word) const {
    constexpr double kMost = 1e9;
    const double value = number(word);
    if (!(value >= 0 && value <= kMost) || value != std::floor(value))
      fail(word, "must be a whole number, 0 or above");
    return static_cast<std::size_t>(value);
  }

 private:
  std::string path_;
  std::istringstream text_;
  int number_ = 0;
};

/// The line with the numbers of vertices and faces, which may stand behind the first word.
std::vector<std::string> off_counts(OffLines& lines) {
  std::vector<std::string> words = lines.next();
  if (words[0].ends_with("OFF")) {
    const std::string what = words[0].substr(0, words[0].size() - 3);
    if (what.find_first_not_of("STCN") != std::string::npos)
      lines.fail(words[0], "must be OFF in three dimensions");
    words.erase(words.begin());
    if (words.empty()) words = lines.next();
    if (words[0] == "BINARY") lines.fail(words[0], "must be OFF as text");
  }
  if (words.size() < 2) lines.fail(words[0], "must be the numbers of vertices and faces");
  return words;
}

}  // namespace

void append_polygon(const std::filesystem::path& path, const std::function<std::string()>& field,
                    std::span<const double> corners, TriangleMesh& mesh) {
  for (const double corner : corners) {
    if (!(corner >= 0) || corner >= static_cast<double>(mesh.vertices.size())) {
      throw InputError(path.string(), field(), std::to_string(corner),
                       "vertex indices must lie below the number of vertices");
    }
  }
  if (corners.size() == 3) {  // most are
    mesh.faces.push_back(
        {static_cast<int>(corners[0]), static_cast<int>(corners[1]), static_cast<int>(corners[2])});
    return;
  }
  std::vector<Vec3> places;
  for (const double corner : corners)
    places.push_back(mesh.vertices[static_cast<std::size_t>(corner)]);
  if (places.size() > kMostConcaveCorners && !is_fan(places)) {
    throw InputError(
        path.string(), field(), std::to_string(places.size()) + " corners",
        "a polygon that is not convex must have at most " + std::to_string(kMostConcaveCorners));
  }
  for (const auto& triangle : triangulated_polygon(places)) {
    mesh.faces.push_back({static_cast<int>(corners[triangle[0]]),
                          static_cast<int>(corners[triangle[1]]),
                          static_cast<int>(corners[triangle[2]])});
  }
}

TriangleMesh read_off_mesh(const std::filesystem::path& path) {
  OffLines lines(path);
  const std::vector<std::string> counts = off_counts(lines);
  const std::size_t vertices = lines.count(counts[0]);
  const std::size_t faces = lines.count(counts[1]);
  TriangleMesh mesh;
  for (std::size_t i = 0; i < vertices; ++i) {
    const std::vector<std::string> words = lines.next();
    if (words.size() < 3) lines.fail(words[0], "must be a vertex: x y z");
    mesh.vertices.emplace_back(lines.number(words[0]), lines.number(words[1]),
                               lines.number(words[2]));
  }
  for (std::size_t f = 0; f < faces; ++f) {
    const std::vector<std::string> words = lines.next();
    const std::size_t size = lines.count(words[0]);
    if (words.size() <= size)
      lines.fail(words[0] + " corners", "must be followed by so many indices of vertices");
    std::vector<double> corners;
    for (std::size_t k = 1; k <= size; ++k)
      corners.push_back(static_cast<double>(lines.count(words[k])));
    append_polygon(
        path, [&] { return lines.field(); }, corners, mesh);
  }
  return mesh;
}

}  // namespace pencilscan
