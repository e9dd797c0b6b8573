#pragma once

#include <memory>
#include <mutex>
#include <nlohmann/json.hpp>
#include <optional>
#include <string>
#include <vector>

#include "pencilscan/page/flaw.h"
#include "pencilscan/page/result_files.h"
#include "pencilscan/page/result_folder.h"
#include "pencilscan/rig/rig.h"

namespace pencilscan {

/// How much of a result the page gets.
struct Detail {
  std::size_t max_faces = 80'000;  ///< of each mesh, >= 100
  std::size_t point_stride = 1;    ///< every how many points, >= 1
  int image_width = 1280;          ///< at most, px
  int image_quality = 72;          ///< WebP, 1..100
  bool evaluate = true;            ///< compute figures where there is a truth and no file has them
  bool shape_only = false;         ///< the closed mesh, figures and a thumbnail
  bool for_playing = false;        ///< meshes as unpacked_mesh()
};

/// One result as parts for the browser. A part that is missing or broken is left out, and missing()
/// says why. Thread safe.
class ResultReader {
 public:
  /// rig: null where none is known.
  ResultReader(ResultEntry entry, std::shared_ptr<const Rig> rig, const Detail& detail);

  /// Names of the parts that the folder seems to hold, by the files that exist: details, thumb,
  /// mesh, measured, points, curves, image/<camera index>, holes/..., depth/...
  [[nodiscard]] std::vector<std::string> part_names() const;
  /// The bytes of a part: compressed JSON (details), an image (thumb, image, holes), or a Block.
  [[nodiscard]] std::optional<std::string> part(const std::string& name);
  /// A few numbers of report.json for lists and timelines; figures against the truth where a file
  /// has them or the part "details" was made before.
  [[nodiscard]] nlohmann::ordered_json summary();
  /// True for points and a surface alone, as `scan` writes them: `line` is a column or row of the
  /// panel then.
  [[nodiscard]] bool is_scan() const;
  /// What is not as it should be, and why: file, reason.
  struct Missing {
    std::string what;
    std::string why;
    Flaw kind = Flaw::kMissing;
  };
  [[nodiscard]] std::vector<Missing> missing() const;
  /// The same for the page: what, why, kind.
  [[nodiscard]] nlohmann::ordered_json missing_json() const;

 private:
  [[nodiscard]] std::optional<std::string> make_part(const std::string& name);
  [[nodiscard]] std::optional<std::string> make_camera_part(const std::string& name);
  [[nodiscard]] nlohmann::ordered_json details();
  [[nodiscard]] nlohmann::ordered_json histograms(bool has_truth);
  /// Notes a true mesh that can hardly be that of the result; false then.
  [[nodiscard]] bool is_truth(const RayScene& truth);
  void note_other_rig();
  void note(const std::string& what, const std::string& why, Flaw kind);
  void note_missing_files();

  std::shared_ptr<const Rig> rig_;
  Detail detail_;
  ResultFiles files_;
  mutable std::mutex mutex_;  ///< guards everything above while a part is made
  std::vector<Missing> missing_;
  nlohmann::json evaluated_;  ///< figures, once details() has computed them
};

}  // namespace pencilscan
