#include "pencilscan/jobs/finish.h"

#include <algorithm>
#include <set>

#include "pencilscan/core/error.h"
#include "pencilscan/core/name_list.h"
#include "pencilscan/jobs/job_folder.h"
#include "pencilscan/pipeline/shard.h"
#include "pencilscan/rig/rig.h"

namespace pencilscan {
namespace {

namespace fs = std::filesystem;

SequenceDevices devices_of_output(const fs::path& out) {
  SequenceDevices devices;
  const fs::path file = out / "devices.json";
  if (!fs::exists(file)) return devices;  // no frame was begun
  const Rig rig = read_rig(file);
  for (const Camera& camera : rig.cameras) devices.cameras.push_back(camera.name);
  for (const Projector& projector : rig.projectors) devices.projectors.push_back(projector.name);
  return devices;
}

/// Why there is nothing, as far as the log of its task says.
std::string why_missing(const fs::path& out, std::size_t row, std::size_t tasks) {
  if (tasks == 0) return "was not made";
  const std::size_t task = shard_of(row, tasks);
  const std::string last = last_log_line(out, task);
  return "was not made by task " + std::to_string(task) +
         (last.empty() ? ", which has not said anything" : ", whose log ends: " + last);
}

std::vector<Hole> holes_of(const fs::path& out, const std::vector<FrameRow>& rows) {
  const std::size_t tasks = has_job(out) ? read_job(out).tasks : 0;
  std::vector<Hole> holes;
  std::vector<std::string> of_task(std::max<std::size_t>(tasks, 1));
  for (std::size_t i = 0; i < rows.size(); ++i) {
    const FrameStatus& status = rows[i].status;
    switch (status.state) {
      case FrameState::kDone:
        break;
      case FrameState::kMissing: {
        std::string& reason = of_task[tasks == 0 ? 0 : shard_of(i, tasks)];
        if (reason.empty()) reason = why_missing(out, i, tasks);
        holes.push_back({i, "missing", reason, true});
        break;
      }
      case FrameState::kFailed: {
        const FrameFailure failure = status.failure.value_or(FrameFailure{});
        holes.push_back({i, "failed", failure.reason, failure.is_passing});
        break;
      }
      case FrameState::kOther:
        holes.push_back({i, "other",
                         "holds the output of another rig, other options or another program",
                         true});
        break;
    }
  }
  return holes;
}

}  // namespace

std::size_t SequenceSummary::odd_frames() const {
  std::set<std::size_t> frames;
  for (const OddFrame& odd : watch.odd) frames.insert(odd.row);
  return frames.size();
}

SequenceSummary summarize_sequence(const fs::path& out) {
  if (!has_run_inputs(out))
    throw InputError("--out", "", out.string(),
                     "must be an output folder of reconstruct (with inputs.json)");
  const RunInputs inputs = read_run_inputs(out);
  if (inputs.frames.empty())
    throw InputError((out / "inputs.json").string(), "frames", "",
                     "must name the frames: an earlier version made it, run reconstruct again");
  SequenceSummary summary;
  summary.devices = devices_of_output(out);
  summary.rows = read_frame_rows(out, inputs, summary.devices);
  summary.holes = holes_of(out, summary.rows);
  summary.watch = watch_sequence(summary.rows, summary.devices);
  for (const OddFrame& odd : summary.watch.odd) summary.rows[odd.row].warnings.push_back(odd.text);
  return summary;
}

std::optional<std::string> not_run_again(const SequenceSummary& summary) {
  std::vector<std::string> names;
  for (const Hole& hole : summary.holes)
    if (!hole.may_fill) names.push_back(summary.rows[hole.row].name);
  if (names.empty()) return std::nullopt;
  return "frames that failed for their pictures, or whose report is damaged, are not run again: " +
         name_list(names, kNamedFrames) +
         "; where pictures were repaired since, give the command that made the sequence once more "
         "with --overwrite: it makes anew what depends on them, and keeps the rest";
}

std::vector<std::size_t> tasks_with_holes(const SequenceSummary& summary, std::size_t tasks) {
  std::vector<char> has_hole(tasks, 0);
  for (const Hole& hole : summary.holes) {
    if (hole.may_fill) has_hole[shard_of(hole.row, tasks)] = 1;
  }
  std::vector<std::size_t> result;
  for (std::size_t i = 0; i < tasks; ++i) {
    if (has_hole[i] != 0) result.push_back(i);
  }
  return result;
}

}  // namespace pencilscan
