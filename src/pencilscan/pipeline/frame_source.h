#pragma once

#include <cstdint>
#include <filesystem>
#include <memory>
#include <string>
#include <vector>

#include "pencilscan/pipeline/frame.h"

namespace pencilscan {

/// The frames of a sequence in their order: of a folder of image folders, or of a recording, whose
/// frames are named by six digits. Names and times are known at once; pictures are read when asked
/// for. Const calls are safe on several threads.
class FrameSource {
 public:
  /// InputError when `path` is neither, has no frame, has no camera of the rig, or gives a camera
  /// another size than the rig does.
  [[nodiscard]] static FrameSource open(const Rig& rig, const std::filesystem::path& path);
  /// Gives every frame its images in plain light: those of the frame of its name below `path`, or
  /// of the only one there. InputError when a frame has none.
  void add_plain(const Rig& rig, const std::filesystem::path& path);

  [[nodiscard]] std::size_t size() const { return names_.size(); }
  [[nodiscard]] const std::string& name(std::size_t frame) const { return names_[frame]; }
  [[nodiscard]] const std::vector<std::string>& names() const { return names_; }
  /// Cameras, by name, that have pictures here and are not of the rig; sorted.
  [[nodiscard]] const std::vector<std::string>& strangers() const { return strangers_; }
  /// Rows of a recording without a picture, and pictures that are in no frame: a sentence each.
  [[nodiscard]] const std::vector<std::string>& left_out() const { return left_out_; }
  /// False of a recording that was cut off, or goes on: frames may lack at its end.
  [[nodiscard]] bool is_closed() const { return closed_; }
  /// The pictures of a frame. InputError for a broken one or, of image folders, one of another size
  /// than its camera. `rig` is the one that it was opened with.
  [[nodiscard]] Frame read(const Rig& rig, std::size_t frame) const;
  /// InputError where read() would have one.
  void check(const Rig& rig, std::size_t frame) const;
  /// FNV-1a hashes of the bytes of a frame's pictures, one per camera, 0 where there is none.
  [[nodiscard]] std::vector<std::uint64_t> picture_hashes(std::size_t frame) const;
  /// The hash of a frame's name and of `pictures`, its picture_hashes(), and of its pictures in
  /// plain light, to tell whether an input is the same.
  [[nodiscard]] std::uint64_t hash(std::size_t frame,
                                   const std::vector<std::uint64_t>& pictures) const;
  [[nodiscard]] std::uint64_t hash(std::size_t frame) const {
    return hash(frame, picture_hashes(frame));
  }

 private:
  /// One of the two ways to store frames.
  struct Storage;
  struct Folders;
  struct Recorded;

  std::shared_ptr<const Storage> storage_;
  std::vector<std::string> names_;
  std::vector<std::string> strangers_;
  std::vector<std::string> left_out_;
  bool closed_ = true;
  std::shared_ptr<const FrameSource> plain_;
  std::vector<std::size_t> plain_of_;  ///< frame of plain_
};

}  // namespace pencilscan
