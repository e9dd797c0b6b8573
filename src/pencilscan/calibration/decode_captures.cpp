#include "pencilscan/calibration/decode_captures.h"

#include <algorithm>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <map>
#include <string>
#include <utility>

#include "pencilscan/calibration/tracks.h"
#include "pencilscan/core/error.h"
#include "pencilscan/core/name_list.h"
#include "pencilscan/gray/gray_decode.h"
#include "pencilscan/gray/image_order.h"
#include "pencilscan/gray/swapped_bits.h"
#include "pencilscan/rig/device_list.h"

namespace pencilscan {
namespace {

struct DecodedPair {
  CapturePair files;
  DecodeSummary summary;
  double sensible = 0;  ///< share of the lit pixels whose codes make sense, of a pair in order
};

/// What the pairs add up to.
struct Collected {
  Collected(const Rig& rig, const std::optional<CalibrationBoard>& board, std::size_t max_tracks)
      : tracks(rig, {.max_tracks = max_tracks}), colors(rig) {
    if (board) boards.emplace(*board);
  }

  TrackBuilder tracks;
  ColorCollector colors;
  std::optional<BoardFinder> boards;
};

/// A view in the right order; says how many correspondences it has.
std::size_t collect(const DecodedPair& pair, const DecodedView& view, const Rig& rig,
                    Collected& collected) {
  const CapturePair& files = pair.files;
  const std::size_t capture = pair.summary.capture;
  const std::size_t before = collected.tracks.samples();
  collected.tracks.add(capture, files.camera, files.projector, view);
  collected.colors.add(files, view);
  if (collected.boards)
    collected.boards->project(capture, files.camera, rig.cameras.size() + files.projector, view);
  return collected.tracks.samples() - before;
}

/// The board is looked for where all of the panel is lit.
GrayStack read_and_look(const DecodedPair& pair, const Rig& rig, Collected& collected) {
  GrayStack stack = read_gray_stack(pair.files, rig);
  if (collected.boards)
    collected.boards->look(pair.summary.capture, pair.files.camera, stack.white);
  return stack;
}

/// Decodes one pair and collects it, unless its codes make no sense.
DecodedPair decode_pair(const CapturePair& files, std::size_t capture, const Rig& rig,
                        Collected& collected) {
  DecodedPair pair{files, {}, 0};
  DecodeSummary& summary = pair.summary;
  summary.capture = capture;
  summary.projector = files.projector;
  summary.camera = files.camera;
  const GrayStack stack = read_and_look(pair, rig, collected);
  const DecodedView view = decode_gray_stack(stack);
  summary.counts = view.counts;
  summary.valid_share = view.valid_share();
  const Projector& projector = rig.projectors[files.projector];
  summary.wrong_order = explain_wrong_order(
      projector.width, projector.height, files.inverses,
      [&](std::size_t i) { return read_gray_image(files, rig, i); }, view);
  if (summary.wrong_order.empty()) summary.wrong_order = explain_swapped_bits(stack, view);
  if (!summary.wrong_order.empty()) return pair;
  pair.sensible = sensible_share(view);
  summary.samples = collect(pair, view, rig, collected);
  return pair;
}

/// The pairs once more without those whose order is wrong.
void collect_again(std::vector<DecodedPair>& pairs, const Rig& rig, Collected& collected) {
  for (DecodedPair& pair : pairs) {
    const GrayStack stack = read_and_look(pair, rig, collected);
    pair.summary.samples = pair.summary.wrong_order.empty()
                               ? collect(pair, decode_gray_stack(stack), rig, collected)
                               : 0;
  }
}

using Pairs = std::vector<DecodedPair*>;

/// One program projects all of these pairs. An order that explains some of them, and in which none
/// of the others makes less sense, is that of all: codes of rows in the place of columns are
/// smooth, too, and leave the panel only where the object reaches far enough.
std::string common_order(const Pairs& pairs, const Rig& rig) {
  std::string order;
  for (const DecodedPair* pair : pairs) {
    const std::string& own = pair->summary.wrong_order;
    if (own.empty()) continue;
    if (!order.empty() && order != own) return {};
    order = own;
  }
  if (order.empty()) return {};
  for (const DecodedPair* pair : pairs) {
    if (!pair->summary.wrong_order.empty()) continue;
    const CapturePair& files = pair->files;
    const Projector& projector = rig.projectors[files.projector];
    const auto in_order =
        sensible_share_in_order(order, projector.width, projector.height, files.inverses,
                                [&](std::size_t k) { return read_gray_image(files, rig, k); });
    if (!in_order || *in_order < pair->sensible) return {};
  }
  return order;
}

/// Gives these pairs their common order; true where a pair had been taken for one in order.
bool apply_common_order(const Pairs& pairs, const Rig& rig) {
  const std::string order = common_order(pairs, rig);
  if (order.empty()) return false;
  bool has_changed = false;
  for (DecodedPair* pair : pairs) {
    has_changed = has_changed || pair->summary.wrong_order.empty();
    pair->summary.wrong_order = order;
  }
  return has_changed;
}

/// Of all captures, or of each that was taken in another way than the others. True where a pair had
/// been taken for one in order.
bool apply_common_orders(std::vector<DecodedPair>& pairs, const Rig& rig) {
  Pairs all;
  std::map<std::size_t, Pairs> of_capture;
  for (DecodedPair& pair : pairs) {
    all.push_back(&pair);
    of_capture[pair.summary.capture].push_back(&pair);
  }
  bool has_changed = apply_common_order(all, rig);
  for (const auto& [capture, own] : of_capture)
    has_changed = apply_common_order(own, rig) || has_changed;
  return has_changed;
}

std::string name_of(const DecodeSummary& pair, const Rig& rig) {
  return rig.projectors[pair.projector].name + "/" + rig.cameras[pair.camera].name +
         " (--captures number " + std::to_string(pair.capture + 1) + ")";
}

/// Whether all pairs of a device are in one wrong order or another.
bool is_all_wrong(const std::vector<DecodeSummary>& pairs, std::size_t device, const Rig& rig) {
  bool has_any = false;
  for (const DecodeSummary& pair : pairs) {
    if (pair.camera != device && rig.cameras.size() + pair.projector != device) continue;
    if (pair.wrong_order.empty()) return false;
    has_any = true;
  }
  return has_any;
}

/// One finding per wrong order. Where it leaves nothing of a device, the rig is unusable for it.
std::vector<Finding> order_findings(const std::vector<DecodeSummary>& pairs, const Rig& rig) {
  constexpr std::size_t kNamed = 3;
  std::map<std::string, std::vector<const DecodeSummary*>> by_order;
  for (const DecodeSummary& pair : pairs)
    if (!pair.wrong_order.empty()) by_order[pair.wrong_order].push_back(&pair);
  std::vector<Finding> findings;
  for (const auto& [order, wrong] : by_order) {
    std::vector<std::string> names;
    std::vector<char> is_of(device_count(rig), 0);
    for (const DecodeSummary* pair : wrong) {
      names.push_back(name_of(*pair, rig));
      is_of[pair->camera] = is_of[rig.cameras.size() + pair->projector] = 1;
    }
    const std::string who = names.size() == pairs.size() && pairs.size() > 1
                                ? "all " + std::to_string(pairs.size()) + " pairs"
                                : name_list(names, kNamed);
    Finding finding{Grade::kDoubtful,
                    "the images of " + who + " are in the wrong order: " + order,
                    "put them in the documented order; they were left out",
                    {}};
    for (std::size_t d = 0; d < is_of.size(); ++d)
      if (is_of[d] != 0 && is_all_wrong(pairs, d, rig)) finding.explains.push_back(d);
    if (!finding.explains.empty()) finding.grade = Grade::kUnusable;
    findings.push_back(std::move(finding));
  }
  return findings;
}

/// Where the board was not found as it was described.
std::optional<Finding> board_finding(const BoardFinder& boards, const std::string& text) {
  if (boards.of_other_size() > 0)
    return Finding{boards.found() == 0 ? Grade::kUnusable : Grade::kDoubtful,
                   "pictures that show a board of another size than " + text + ": " +
                       std::to_string(boards.of_other_size()),
                   "count all inner corners of the board; those pictures were left out",
                   {}};
  if (boards.found() == 0)
    return Finding{Grade::kDoubtful,
                   "the board " + text + " is in no picture of any camera",
                   "count its inner corners, and let a camera see all of it lit",
                   {}};
  return std::nullopt;
}

/// InputError where two of the folders are one, however they are spelt.
void require_different(const std::vector<std::filesystem::path>& folders) {
  std::error_code ignored;  // of what does not exist, which reading it tells
  for (std::size_t b = 0; b < folders.size(); ++b) {
    for (std::size_t a = 0; a < b; ++a) {
      if (std::filesystem::equivalent(folders[a], folders[b], ignored))
        throw InputError(folders[b].string(), "", "",
                         "must be another folder than " + folders[a].string() +
                             ": each holds the captures of one pose");
    }
  }
}

bool is_same_file(const std::filesystem::path& a, const std::filesystem::path& b) {
  if (std::filesystem::file_size(a) != std::filesystem::file_size(b)) return false;
  std::ifstream one(a, std::ios::binary);
  std::ifstream other(b, std::ios::binary);
  return std::equal(std::istreambuf_iterator<char>(one), {}, std::istreambuf_iterator<char>(other),
                    {});
}

/// Whether two captures of one rig are copies of each other, byte by byte: sensors never repeat
/// themselves. The first picture that differs ends it.
bool is_same_capture(const std::vector<CapturePair>& a, const std::vector<CapturePair>& b) {
  return std::equal(a.begin(), a.end(), b.begin(), b.end(),
                    [](const CapturePair& one, const CapturePair& other) {
                      return one.camera == other.camera && one.projector == other.projector &&
                             std::equal(one.files.begin(), one.files.end(), other.files.begin(),
                                        other.files.end(), is_same_file);
                    });
}

/// Captures that are copies of one before have no pairs any more; says so of each.
std::vector<Finding> leave_out_copies(const std::vector<std::filesystem::path>& folders,
                                      std::vector<std::vector<CapturePair>>& captures) {
  std::vector<Finding> findings;
  for (std::size_t b = 1; b < captures.size(); ++b) {
    for (std::size_t a = 0; a < b; ++a) {
      if (!is_same_capture(captures[a], captures[b])) continue;
      captures[b].clear();
      findings.push_back({Grade::kDoubtful,
                          folders[b].string() + " holds the same pictures as " +
                              folders[a].string() + ": it is no other pose, and was left out",
                          "give the captures of each pose once"});
      break;
    }
  }
  return findings;
}

}  // namespace

DecodedCaptures decode_captures(const Rig& rig, const std::vector<std::filesystem::path>& folders,
                                const std::string& board, std::size_t max_tracks,
                                const Progress& progress) {
  require_different(folders);
  std::optional<CalibrationBoard> described;
  if (!board.empty()) described = board_from_text(board, "--board");
  std::vector<std::vector<CapturePair>> captures;
  captures.reserve(folders.size());
  for (const std::filesystem::path& folder : folders)
    captures.push_back(list_captures(folder, rig));
  std::vector<Finding> copies = leave_out_copies(folders, captures);

  std::optional<Collected> collected(std::in_place, rig, described, max_tracks);
  std::vector<DecodedPair> pairs;
  for (std::size_t k = 0; k < captures.size(); ++k) {
    for (std::size_t i = 0; i < captures[k].size(); ++i) {
      if (progress)
        progress("decoding", (static_cast<double>(k) +
                              static_cast<double>(i) / static_cast<double>(captures[k].size())) /
                                 static_cast<double>(captures.size()));
      pairs.push_back(decode_pair(captures[k][i], k, rig, *collected));
    }
  }
  if (apply_common_orders(pairs, rig)) {
    collected.emplace(rig, described, max_tracks);
    collect_again(pairs, rig, *collected);
  }

  DecodedCaptures decoded;
  for (DecodedPair& pair : pairs) decoded.pairs.push_back(std::move(pair.summary));
  decoded.tracks = collected->tracks.tracks();
  decoded.color = collected->colors.result();
  decoded.findings = order_findings(decoded.pairs, rig);
  for (Finding& copy : copies) decoded.findings.push_back(std::move(copy));
  if (const auto& boards = collected->boards) {
    decoded.board_views = boards->views();
    decoded.projected_corners = boards->projected_views();
    if (auto finding = board_finding(*boards, board))
      decoded.findings.push_back(std::move(*finding));
  }
  return decoded;
}

}  // namespace pencilscan
