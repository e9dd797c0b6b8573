#include "pencilscan/calibration/from_captures.h"

#include <algorithm>
#include <map>
#include <nlohmann/json.hpp>
#include <string>

#include "pencilscan/boards/board.h"
#include "pencilscan/calibration/mirrored.h"
#include "pencilscan/calibration/scale_deviation.h"
#include "pencilscan/core/error.h"
#include "pencilscan/core/name_list.h"
#include "pencilscan/gray/gray_decode.h"
#include "pencilscan/gray/image_order.h"
#include "pencilscan/gray/swapped_bits.h"
#include "pencilscan/planning/units.h"
#include "pencilscan/rig/device_list.h"

namespace pencilscan {
namespace {

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

/// One program projects all pairs. An order that explains some of them, and in which none of the
/// others makes less sense, is that of all: codes of rows in the place of columns are smooth, too,
/// and leave the panel only where the object reaches far enough.
std::string common_order(const std::vector<DecodeSummary>& decoded,
                         const std::vector<CapturePair>& pairs, const std::vector<double>& sensible,
                         const Rig& rig) {
  std::string order;
  for (const DecodeSummary& pair : decoded) {
    if (pair.wrong_order.empty()) continue;
    if (!order.empty() && order != pair.wrong_order) return {};
    order = pair.wrong_order;
  }
  if (order.empty()) return {};
  for (std::size_t i = 0; i < pairs.size(); ++i) {
    if (!decoded[i].wrong_order.empty()) continue;
    const CapturePair& pair = pairs[i];
    const Projector& projector = rig.projectors[pair.projector];
    const auto in_order =
        sensible_share_in_order(order, projector.width, projector.height, pair.inverses,
                                [&](std::size_t k) { return read_gray_image(pair, rig, k); });
    if (!in_order || *in_order < sensible[i]) return {};
  }
  return order;
}

/// Decodes one pair and adds its correspondences, unless the codes make no sense; looks for the
/// board where all of the panel is lit.
DecodeSummary decode_pair(const CapturePair& pair, std::size_t capture, const Rig& rig,
                          TrackBuilder& tracks, ColorCollector& colors, BoardFinder* boards,
                          double& sensible) {
  const Projector& projector = rig.projectors[pair.projector];
  const GrayStack stack = read_gray_stack(pair, rig);
  if (boards != nullptr) boards->look(capture, pair.camera, stack.white);
  const DecodedView view = decode_gray_stack(stack);
  DecodeSummary summary{capture, pair.projector, pair.camera, view.counts, view.valid_share(), 0,
                        {}};
  summary.wrong_order = explain_wrong_order(
      projector.width, projector.height, pair.inverses,
      [&](std::size_t i) { return read_gray_image(pair, rig, i); }, view);
  if (summary.wrong_order.empty()) summary.wrong_order = explain_swapped_bits(stack, view);
  if (!summary.wrong_order.empty()) return summary;
  sensible = sensible_share(view);
  const std::size_t before = tracks.samples();
  tracks.add(capture, pair.camera, pair.projector, view);
  colors.add(pair, view);
  if (boards != nullptr)
    boards->project(capture, pair.camera, rig.cameras.size() + pair.projector, view);
  summary.samples = tracks.samples() - before;
  return summary;
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

}  // namespace

CapturesCalibration calibrate_captures(const UncalibratedRig& devices,
                                       const std::vector<std::filesystem::path>& folders,
                                       const CapturesOptions& options, const Progress& progress) {
  const auto tell = [&](const char* stage, double done) {
    if (progress) progress(stage, done);
  };
  require_different(folders);
  CapturesCalibration all;
  CalibrationInput& input = all.input;
  input.rig = devices.rig;
  input.known = devices.given;
  input.distance = options.distance;

  std::optional<BoardFinder> boards;
  if (!options.board.empty()) boards.emplace(board_from_text(options.board, "--board"));

  GrayTrackOptions track_options;
  track_options.max_tracks = options.max_tracks;
  std::optional<TrackBuilder> tracks(std::in_place, input.rig, track_options);
  std::optional<ColorCollector> colors(std::in_place, input.rig);
  std::vector<std::vector<CapturePair>> captures;
  std::vector<CapturePair> pairs;
  std::vector<double> sensible;  // per pair
  for (const std::filesystem::path& folder : folders)
    captures.push_back(list_captures(folder, input.rig));
  for (std::size_t k = 0; k < captures.size(); ++k) {
    for (std::size_t i = 0; i < captures[k].size(); ++i) {
      tell("decoding", (static_cast<double>(k) +
                        static_cast<double>(i) / static_cast<double>(captures[k].size())) /
                           static_cast<double>(captures.size()));
      pairs.push_back(captures[k][i]);
      sensible.push_back(0);
      all.decoded.push_back(decode_pair(pairs.back(), k, input.rig, *tracks, *colors,
                                        boards ? &*boards : nullptr, sensible.back()));
    }
  }
  const std::string order = common_order(all.decoded, pairs, sensible, input.rig);
  if (!order.empty()) {
    for (DecodeSummary& pair : all.decoded) pair.wrong_order = order;
    tracks.emplace(input.rig, track_options);
    colors.emplace(input.rig);
  }
  std::vector<Finding> findings = order_findings(all.decoded, input.rig);
  input.tracks = tracks->tracks();
  if (boards) {
    input.board_views = boards->views();
    input.projected_corners = boards->projected_views();
    input.boards = folders.size();
    if (boards->of_other_size() > 0)
      findings.push_back({boards->found() == 0 ? Grade::kUnusable : Grade::kDoubtful,
                          "pictures that show a board of another size than " + options.board +
                              ": " + std::to_string(boards->of_other_size()),
                          "count all inner corners of the board; those pictures were left out"});
    else if (boards->found() == 0)
      findings.push_back({Grade::kDoubtful,
                          "the board " + options.board + " is in no picture of any camera",
                          "count its inner corners, and let a camera see all of it lit"});
  }

  CalibrateOptions calibrate_options;
  calibrate_options.tolerance = options.tolerance;
  all.result = calibrate(input, calibrate_options, progress);
  all.color = colors->result();
  set_colors(all.color, all.result.rig);
  tell("judging", 0.9);
  all.uncertainty.devices.resize(device_count(input.rig));
  if (all.result.solved)
    all.uncertainty = uncertainty(all.result.problem, all.result.adjustment, options.seed);
  all.loop = close_loop(all.result);
  if (const auto finding = judge_loop(all.result, all.loop)) findings.push_back(*finding);
  if (auto warning = all.result.solved ? pose_unit_warning(all.result.rig) : std::nullopt)
    findings.push_back({Grade::kDoubtful, std::move(*warning), "give the known distance in mm"});
  all.verdict = judge(input, all.result, all.uncertainty, std::move(findings));
  if (all.verdict.grade == Grade::kUnusable) {
    if (auto finding = find_mirrored(input, all.result, calibrate_options, progress))
      all.verdict.findings.insert(all.verdict.findings.begin(), std::move(*finding));
  }
  tell("judging", 1);
  return all;
}

nlohmann::ordered_json calibration_json(const CapturesCalibration& calibration) {
  return calibration_json(CalibrationReport{
      calibration.input, calibration.result, calibration.uncertainty, calibration.verdict,
      calibration.decoded, calibration.loop, calibration.color});
}

nlohmann::ordered_json calibration_figures(const CapturesCalibration& calibration) {
  const CalibrationResult& result = calibration.result;
  const Verdict& verdict = calibration.verdict;
  nlohmann::ordered_json figures;
  figures["verdict"] = to_string(verdict.grade);
  for (const Finding& finding : verdict.findings)
    if (finding.grade == verdict.grade && verdict.grade != Grade::kGood)
      figures["reasons"].push_back(finding.what);
  figures["rms_px"] = result.rms_px;
  figures["held_out_rms_px"] = result.held_out_rms_px;
  if (!result.problem.board_views.empty()) figures["board_rms_px"] = result.board_rms_px;
  figures["views"] = result.views;
  figures["views_dropped"] = result.views_dropped;
  figures["point_sigma"] = calibration.uncertainty.volume_median;
  if (const auto scale = scale_deviation(calibration.input, result, calibration.uncertainty))
    figures["length_sigma_percent"] = 100 * scale->share;
  figures["unit"] = result.rig.unit_known ? "mm" : "unknown";
  return figures;
}

}  // namespace pencilscan
