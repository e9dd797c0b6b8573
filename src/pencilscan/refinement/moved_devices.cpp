#include "pencilscan/refinement/moved_devices.h"

#include "pencilscan/geometry/least_squares.h"

namespace pencilscan {
namespace {

bool is_off(const DeviceMove& move, const MovedDevicesOptions& options) {
  return move.shift_px > options.smallest_px && move.gain > options.smallest_gain;
}

std::vector<DeviceMove> each_alone(const DeviceMover& mover) {
  std::vector<DeviceMove> moves;
  for (std::size_t d = 0; d < mover.devices(); ++d) moves.push_back(mover.alone(d));
  return moves;
}

/// The best place of a device over several frames, and what it costs more than a place for each:
/// sums over frames of I, I x and x' I x.
struct CommonPlace {
  Mat6 information = Mat6::Zero();
  Vec6 weighted = Vec6::Zero();
  double squares = 0;

  void add(const DeviceMover::Place& place) {
    const Vec6 own = place.information * place.motion;
    information += place.information;
    weighted += own;
    squares += place.motion.dot(own);
  }
  [[nodiscard]] bool is_known() const { return !information.isZero(0); }
  [[nodiscard]] Vec6 best() const { return solve_symmetric(information, weighted); }
  [[nodiscard]] double cost() const { return squares - weighted.dot(best()); }
  [[nodiscard]] Mat6 covariance() const {
    return solve_symmetric(Eigen::MatrixXd(information), Mat6::Identity());
  }
};

}  // namespace

MovedDevices find_moved_devices(const Rig& rig, std::span<const CrossingTrack> tracks,
                                const MovedDevicesOptions& options) {
  MovedDevices result;
  const std::vector<std::vector<CrossingTrack>> together = {{tracks.begin(), tracks.end()}};
  DeviceMover mover(rig, together, options);
  result.alone = each_alone(mover);
  std::vector<DeviceMove> moves = result.alone;
  std::vector<char> is_accused(mover.devices(), 0);
  while (true) {
    // Those that are accused may still have to move a little further: only the others count.
    const DeviceMove* most = nullptr;
    for (const DeviceMove& move : moves) {
      if (is_accused[move.device] == 0 && is_off(move, options) &&
          (most == nullptr || move.gain > most->gain))
        most = &move;
    }
    if (most == nullptr) return result;
    is_accused[most->device] = 1;
    result.moved.push_back(*most);
    mover.put_back(*most);
    moves = each_alone(mover);
  }
}

RigCorrection correction_of(std::span<const DeviceMove> moves, std::size_t devices) {
  RigCorrection correction(devices);
  for (const DeviceMove& move : moves) correction[move.device] = move.correction;
  return correction;
}

std::optional<MoveBetweenFrames> find_move_between(
    const Rig& rig, std::span<const std::vector<CrossingTrack>> tracks,
    std::span<const std::size_t> devices, const MovedDevicesOptions& options) {
  const DeviceMover mover(rig, tracks, options);
  std::optional<MoveBetweenFrames> most;
  for (const std::size_t d : devices) {
    std::vector<CommonPlace> before(tracks.size() + 1);  // frame f: of the frames before it
    for (std::size_t f = 0; f < tracks.size(); ++f) {
      before[f + 1] = before[f];
      before[f + 1].add(mover.place_in(d, f));
    }
    const CommonPlace& all = before.back();
    for (std::size_t f = 1; f < tracks.size(); ++f) {
      const CommonPlace& first = before[f];
      const CommonPlace last{all.information - first.information, all.weighted - first.weighted,
                             all.squares - first.squares};
      if (!first.is_known() || !last.is_known()) continue;
      MoveBetweenFrames move{d, f, 0, 0, all.cost() - first.cost() - last.cost()};
      if (move.gain <= options.smallest_gain || (most && move.gain <= most->gain)) continue;
      const DeviceMover::Shift shift =
          mover.shift_of(d, last.best() - first.best(), first.covariance() + last.covariance());
      move.shift_px = shift.px;
      move.sigma_px = shift.sigma_px;
      if (move.shift_px > options.smallest_px) most = move;
    }
  }
  return most;
}

}  // namespace pencilscan
