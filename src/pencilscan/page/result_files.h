#pragma once

#include <functional>
#include <nlohmann/json.hpp>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "pencilscan/geometry/ray_scene.h"
#include "pencilscan/io/curve_file.h"
#include "pencilscan/page/geometry_blocks.h"
#include "pencilscan/page/result_folder.h"

namespace pencilscan {

/// A value that is made when it is first asked for; that there is none is kept, too.
template <class T>
class Lazy {
 public:
  template <class Make>
  const T* get(Make make) {
    if (!tried_) {
      tried_ = true;
      value_ = make();
    }
    return value_ ? &*value_ : nullptr;
  }

 private:
  bool tried_ = false;
  std::optional<T> value_;
};

/// The files of one result, each read when it is first needed; null where it is missing or broken.
/// Of a broken file, `note` is told its name and the reason. Not thread safe.
class ResultFiles {
 public:
  using Note = std::function<void(const std::string& file, const std::string& reason)>;

  /// rig: null where none is known. Meshes are decimated to max_faces.
  ResultFiles(ResultEntry entry, const Rig* rig, std::size_t max_faces, Note note);

  [[nodiscard]] const nlohmann::json* report();
  [[nodiscard]] const nlohmann::json* timing();
  [[nodiscard]] const nlohmann::json* figures();
  [[nodiscard]] const std::vector<MeasuredPoint>* points();
  [[nodiscard]] const CurveFile* curves();
  [[nodiscard]] const TriangleMesh* mesh();
  [[nodiscard]] const TriangleMesh* measured();
  [[nodiscard]] const RayScene* measured_scene();
  [[nodiscard]] const RayScene* truth();
  [[nodiscard]] const PointErrors* errors();  ///< needs points, truth and rig

  [[nodiscard]] const ResultEntry& entry() const { return entry_; }

 private:
  /// read(file) unless it is absent or broken.
  template <class Read>
  auto attempt(const std::filesystem::path& file, Read read) -> std::optional<decltype(read(file))>;

  ResultEntry entry_;
  const Rig* rig_;
  std::size_t max_faces_;
  Note note_;
  Lazy<nlohmann::json> report_, timing_, figures_;
  Lazy<std::vector<MeasuredPoint>> points_;
  Lazy<CurveFile> curves_;
  Lazy<TriangleMesh> mesh_, measured_;
  Lazy<RayScene> measured_scene_, truth_;
  Lazy<PointErrors> errors_;
};

/// True for a file that is there.
[[nodiscard]] bool is_file(const std::filesystem::path& path);

}  // namespace pencilscan
