#include "pencilscan/page/experiment_pictures.h"

#include <algorithm>
#include <fstream>
#include <map>
#include <opencv2/imgcodecs.hpp>
#include <opencv2/imgproc.hpp>
#include <set>

#include "pencilscan/core/error.h"
#include "pencilscan/core/evenly_picked.h"
#include "pencilscan/core/formatted.h"
#include "pencilscan/core/lower_case.h"
#include "pencilscan/core/parallel.h"
#include "pencilscan/io/codec.h"
#include "pencilscan/io/file.h"
#include "pencilscan/io/image.h"
#include "pencilscan/page/block.h"

namespace pencilscan {
namespace {

namespace fs = std::filesystem;
using Kind = ExperimentPicture::Kind;

std::string lower_ending(const fs::path& file) { return lower_case(file.extension().string()); }

std::string media_type(const fs::path& file) {
  static const std::map<std::string, std::string> types = {
      {".png", "image/png"},   {".jpg", "image/jpeg"}, {".jpeg", "image/jpeg"},
      {".webp", "image/webp"}, {".gif", "image/gif"},  {".svg", "image/svg+xml"},
      {".mp4", "video/mp4"},   {".webm", "video/webm"}};
  const auto known = types.find(lower_ending(file));
  return known == types.end() ? "" : known->second;
}

/// A picture as it goes into the page.
struct Shown {
  std::string type;
  std::string bytes;
  bool packed = false;  ///< compressed once more
  cv::Size size{0, 0};  ///< px, of the file; 0: not known
  std::string broken;   ///< the reason, where it cannot be shown
};

void check_start(const fs::path& file, const std::string& bytes, Kind kind) {
  const std::string start = bytes.substr(0, 4096);
  const auto has = [&](std::size_t at, const char* mark) {
    return start.compare(std::min(at, start.size()), std::string(mark).size(), mark) == 0;
  };
  bool right = false;
  switch (kind) {
    case Kind::kDrawing:
      right = start.find("<svg") != std::string::npos && bytes.find("</svg") != std::string::npos;
      break;
    case Kind::kVideo:
      right = has(4, "ftyp") || has(0, "\x1A\x45\xDF\xA3");
      break;
    default:
      right = has(0, "GIF8") || (has(0, "RIFF") && has(8, "WEBP"));
  }
  if (!right) throw InputError(file.string(), "", "", "must be what its ending says");
}

/// A photograph or plot: as it is where it is small, and else as WebP of at most `width` pixels.
Shown still(const fs::path& file, std::string bytes, int width, int quality) {
  constexpr std::size_t kSmall = 250'000;
  const cv::Mat image = read_image(file);  // also says what is broken
  Shown shown{media_type(file), std::move(bytes), false, image.size(), ""};
  if (image.cols <= width && shown.bytes.size() <= kSmall) return shown;
  cv::Mat small;
  const double scale = std::min(1.0, static_cast<double>(width) / image.cols);
  cv::resize(image, small, {}, scale, scale, cv::INTER_AREA);
  small.convertTo(small, CV_8UC3, 255);
  std::string encoded = encoded_picture(small, ".webp", {cv::IMWRITE_WEBP_QUALITY, quality});
  if (encoded.size() < shown.bytes.size()) {
    shown.type = "image/webp";
    shown.bytes = std::move(encoded);
  }
  return shown;
}

Shown read_shown(const ExperimentPicture& picture, const ExperimentDetail& detail) {
  try {
    std::string bytes = read_file(picture.file);
    const bool webp = lower_ending(picture.file) == ".webp";
    if (picture.kind == Kind::kStill && !webp) {
      return still(picture.file, std::move(bytes),
                   picture.group.empty() ? detail.max_width : detail.gallery_width, detail.quality);
    }
    check_start(picture.file, bytes, picture.kind);
    if (picture.kind == Kind::kDrawing)
      return {media_type(picture.file), compress(bytes), true, {}, ""};
    return {media_type(picture.file), std::move(bytes), false, {}, ""};
  } catch (const std::exception& error) {
    Shown broken;
    broken.broken = std::string("unreadable: ") + error.what();
    return broken;
  }
}

std::size_t embedded(std::size_t bytes) { return bytes * 4 / 3 + 80; }

std::string group_key(const ExperimentPicture& picture) {
  const std::string name = picture.file.stem().string();
  return picture.group + "/" + name.substr(0, name.find('_'));
}

const char* kind_name(Kind kind) {
  switch (kind) {
    case Kind::kStill:
      return "still";
    case Kind::kDrawing:
      return "drawing";
    case Kind::kMoving:
      return "moving";
    case Kind::kVideo:
      return "video";
  }
  return "";
}

/// Collects pictures into a page while there is room.
class Album {
 public:
  Album(const ExperimentFolder& folder, const ExperimentDetail& detail, ExperimentPage& page)
      : folder_(folder), detail_(detail), page_(page) {}

  void add(const std::vector<const ExperimentPicture*>& pictures, const FlawNote& note) {
    std::vector<Shown> shown(pictures.size());
    parallel_for(pictures.size(),
                 [&](std::size_t i) { shown[i] = read_shown(*pictures[i], detail_); });
    for (std::size_t i = 0; i < pictures.size(); ++i) add_one(*pictures[i], shown[i], note);
  }
  [[nodiscard]] std::size_t room() const {
    return used_ < detail_.max_bytes ? detail_.max_bytes - used_ : 0;
  }

 private:
  void add_one(const ExperimentPicture& picture, Shown& shown, const FlawNote& note) {
    const std::string name = fs::relative(picture.file, folder_.root).generic_string();
    if (!shown.broken.empty()) return note(name, shown.broken, Flaw::kUnreadable);
    const std::size_t bytes = embedded(shown.bytes.size());
    if (bytes > room()) {
      const std::string megabytes = fixed(static_cast<double>(bytes) / 1e6, 1);
      return note(name, "left out: its " + megabytes + " MB do not fit (--max-size)", Flaw::kNote);
    }
    used_ += bytes;
    nlohmann::ordered_json entry = {{"file", name},
                                    {"group", picture.group},
                                    {"kind", kind_name(picture.kind)},
                                    {"type", shown.type},
                                    {"part", page_.pictures.size()}};
    if (shown.packed) entry["packed"] = true;
    if (shown.size.width > 0) {
      entry["width"] = shown.size.width;
      entry["height"] = shown.size.height;
    }
    page_.json["pictures"].push_back(std::move(entry));
    page_.pictures.push_back(std::move(shown.bytes));
  }

  const ExperimentFolder& folder_;
  const ExperimentDetail& detail_;
  ExperimentPage& page_;
  std::size_t used_ = 0;
};

/// Of the pictures in folders, those whose frames fit, judged by the first frame's.
std::vector<const ExperimentPicture*> picked(const std::vector<const ExperimentPicture*>& pictures,
                                             const ExperimentDetail& detail, std::size_t room) {
  std::vector<std::string> keys;
  for (const auto* picture : pictures) {
    if (keys.empty() || keys.back() != group_key(*picture)) keys.push_back(group_key(*picture));
  }
  std::size_t first = 0;
  for (const auto* picture : pictures) {
    if (group_key(*picture) == keys.front())
      first += embedded(read_shown(*picture, detail).bytes.size());
  }
  // A tenth less: other frames may be larger.
  const auto fit = static_cast<std::size_t>(0.9 * static_cast<double>(room) /
                                            static_cast<double>(std::max<std::size_t>(first, 1)));
  const std::vector<std::string> picked = evenly_picked(keys, fit);
  const std::set<std::string> chosen(picked.begin(), picked.end());
  std::vector<const ExperimentPicture*> result;
  for (const auto* picture : pictures) {
    if (chosen.contains(group_key(*picture))) result.push_back(picture);
  }
  return result;
}

}  // namespace

std::optional<Kind> picture_kind(const fs::path& file) {
  const std::string type = media_type(file);
  if (type.empty()) return std::nullopt;
  if (type == "image/svg+xml") return Kind::kDrawing;
  if (type == "image/gif") return Kind::kMoving;
  if (type.starts_with("video/")) return Kind::kVideo;
  if (type != "image/webp") return Kind::kStill;
  // RIFF container: the second bit of the extended header's flags says that it moves.
  std::array<char, 21> start{};
  std::ifstream(file, std::ios::binary).read(start.data(), start.size());
  const bool extended = std::string(start.data() + 12, 4) == "VP8X";
  return extended && (static_cast<unsigned char>(start[20]) & 2U) != 0 ? Kind::kMoving
                                                                       : Kind::kStill;
}

void add_pictures(const ExperimentFolder& folder, const ExperimentDetail& detail,
                  const FlawNote& note, ExperimentPage& page) {
  page.json["pictures"] = nlohmann::ordered_json::array();
  std::vector<const ExperimentPicture*> own;
  std::vector<const ExperimentPicture*> gallery;
  for (const ExperimentPicture& picture : folder.pictures)
    (picture.group.empty() ? own : gallery).push_back(&picture);
  Album album(folder, detail, page);
  album.add(own, note);
  if (gallery.empty()) return;
  const auto shown = picked(gallery, detail, album.room());
  album.add(shown, note);
  if (shown.size() < gallery.size()) {
    note(gallery.front()->group + "/",
         std::to_string(gallery.size() - shown.size()) + " of its " +
             std::to_string(gallery.size()) +
             " pictures are left out: they do not fit (--max-size)",
         Flaw::kNote);
  }
}

}  // namespace pencilscan
