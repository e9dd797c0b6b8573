#include "pencilscan/pipeline/surface_chain.h"

#include <algorithm>
#include <system_error>
#include <utility>

#include "pencilscan/io/hash.h"
#include "pencilscan/pipeline/shard.h"
#include "pencilscan/tracking/steady.h"

namespace pencilscan {
namespace {

namespace fs = std::filesystem;

constexpr const char* kSurfacesFolder = ".surfaces";
constexpr std::size_t kRunIn = kMemoryMoments;

/// The file only saves time, should the program be killed: a full disk, or another program that
/// just removed the empty folder, is no reason to fail the frame.
void write_or_leave(const fs::path& file, const TrackedSurface& surface, const std::string& key) {
  try {
    write_tracked_surface(file, surface, key);
  } catch (const StageError&) {
  }
}

}  // namespace

std::size_t first_of_chain(std::size_t frame) {
  const std::size_t chunk = frame / kChunkFrames * kChunkFrames;
  return chunk - std::min(chunk, kRunIn);
}

std::vector<std::string> chain_keys(const std::vector<std::string>& hashes) {
  std::vector<std::string> keys(hashes.size());
  for (std::size_t i = 0; i < hashes.size(); ++i) {
    if (hashes[i].empty()) continue;
    std::string all;
    for (std::size_t k = first_of_chain(i); k <= i; ++k) all += hashes[k] + "\n";
    keys[i] = hex(hash_bytes(all));
  }
  return keys;
}

SurfaceChain::SurfaceChain(fs::path out, std::vector<std::string> names,
                           std::vector<std::string> keys, const std::vector<std::size_t>& own,
                           const std::vector<char>& there)
    : out_(std::move(out)), names_(std::move(names)), keys_(std::move(keys)) {
  for (std::size_t begin = 0; begin < own.size();) {
    std::vector<std::size_t> frames;
    std::vector<char> made;
    std::size_t end = begin;
    for (; end < own.size() && own[end] / kChunkFrames == own[begin] / kChunkFrames; ++end) {
      frames.push_back(own[end]);
      made.push_back(there[end]);
    }
    add_chunk(frames, made);
    begin = end;
  }
  promises_.resize(steps_.size());
  for (std::promise<Surface>& promise : promises_)
    surfaces_.push_back(promise.get_future().share());
  is_handed_on_.assign(steps_.size(), 0);
}

void SurfaceChain::add_chunk(const std::vector<std::size_t>& frames,
                             const std::vector<char>& there) {
  const auto missing = std::find(there.begin(), there.end(), 0);
  auto begin = static_cast<std::size_t>(missing - there.begin());
  const bool is_whole = missing == there.end();
  // A program that is killed leaves surfaces behind; one of them is gone on from.
  std::error_code ignored;
  if (fs::exists(out_ / kSurfacesFolder, ignored)) {
    for (std::size_t i = 0; i < frames.size(); ++i) {
      if (is_whole || i + 1 != begin) forget(frames[i]);
    }
  }
  if (is_whole) return;
  std::size_t end = there.size();
  while (there[end - 1] != 0) --end;
  Surface first;
  if (begin > 0) {
    const std::size_t before = frames[begin - 1];
    if (auto found = read_tracked_surface(file_of(before), keys_[before]))
      first = std::make_shared<const TrackedSurface>(std::move(*found));
  }
  if (!first) {
    begin = 0;
    for (std::size_t frame = first_of_chain(frames[0]); frame < frames[0]; ++frame)
      steps_.push_back({frame, false, frame > first_of_chain(frames[0]), nullptr});
  }
  for (std::size_t i = begin; i < end; ++i) {
    const bool starts = i == begin && (first || first_of_chain(frames[0]) == frames[0]);
    steps_.push_back({frames[i], there[i] == 0, !starts, starts ? first : nullptr});
  }
}

SurfaceChain::Surface SurfaceChain::before(std::size_t step) const {
  return steps_[step].follows ? surfaces_[step - 1].get() : steps_[step].first;
}

FrameLinks SurfaceChain::linked(FrameLinks links, std::size_t step) {
  links.before = [this, step] { return before(step); };
  links.hand_on = [this, step](Surface surface) { hand_on(step, std::move(surface)); };
  return links;
}

void SurfaceChain::hand_on(std::size_t step, Surface surface) {
  // A run-in is no place to go on from: its frames belong to the chunk before.
  const std::size_t frame = steps_[step].frame;
  if (surface && steps_[step].is_written && is_followed(step))
    write_or_leave(file_of(frame), *surface, keys_[frame]);
  is_handed_on_[step] = 1;
  promises_[step].set_value(std::move(surface));
  promises_[step] = {};  // it would hold the surface as long as the chain lives
}

void SurfaceChain::end(std::size_t step, bool broken) {
  const bool is_cut = broken && is_handed_on_[step] == 0;
  if (is_cut) {
    cut(step, std::make_exception_ptr(
                  ChainBroken("frame " + names_[steps_[step].frame] +
                              ", which it starts from, could not be made this time")));
  } else if (is_handed_on_[step] == 0) {
    try {
      hand_on(step, before(step));
    } catch (const std::exception&) {
      cut(step, std::current_exception());
    }
  }
  // Nobody asks for these surfaces any more.
  if (steps_[step].follows) surfaces_[step - 1] = {};
  if (!is_followed(step)) surfaces_[step] = {};
  if (is_cut) return;
  // Should the program end now, it goes on from this frame, or from the one before while that is
  // still being written.
  if (std::exchange(steps_[step].first, nullptr)) forget(steps_[step].frame - 1);
  if (steps_[step].follows && step >= 2) forget_step(step - 2);
  if (is_followed(step)) return;
  if (step >= 1) forget_step(step - 1);
  forget_step(step);
}

void SurfaceChain::cut(std::size_t step, std::exception_ptr why) {
  is_handed_on_[step] = 1;
  promises_[step].set_exception(std::move(why));
}

bool SurfaceChain::is_followed(std::size_t step) const {
  return step + 1 < steps_.size() && steps_[step + 1].follows;
}

fs::path SurfaceChain::file_of(std::size_t frame) const {
  return out_ / kSurfacesFolder / names_[frame];
}

void SurfaceChain::forget_step(std::size_t step) const {
  if (steps_[step].is_written) forget(steps_[step].frame);
}

void SurfaceChain::forget(std::size_t frame) const {
  std::error_code ignored;
  fs::remove(file_of(frame), ignored);
  fs::remove(out_ / kSurfacesFolder, ignored);  // the last one does it
}

}  // namespace pencilscan
