#include "pencilscan/pipeline/shard.h"

#include <charconv>
#include <cstdlib>

#include "pencilscan/core/error.h"

namespace pencilscan {
namespace {

/// How one scheduler numbers the tasks of an array. Empty names are not set by it.
struct ArrayIndex {
  const char* index;
  const char* first;  ///< variable of the first index; empty: 0
  const char* last;   ///< variable of the last index
  const char* count;  ///< variable of the number of tasks
  const char* step;   ///< variable of the step between indices
};

/// Slurm: job_array.html. Grid Engine: qsub(1) -t. Kubernetes gives the index alone; the number is
/// to be passed on (docs/sequences.md), as for PBS (qsub -J) and AWS Batch. OpenMPI: mpirun(1).
constexpr ArrayIndex kSchedulers[] = {
    {"SLURM_ARRAY_TASK_ID", "SLURM_ARRAY_TASK_MIN", "SLURM_ARRAY_TASK_MAX",
     "SLURM_ARRAY_TASK_COUNT", "SLURM_ARRAY_TASK_STEP"},
    {"SGE_TASK_ID", "SGE_TASK_FIRST", "SGE_TASK_LAST", "", "SGE_TASK_STEPSIZE"},
    {"PBS_ARRAY_INDEX", "", "", "PENCILSCAN_SHARDS", ""},
    {"PBS_ARRAYID", "", "", "PENCILSCAN_SHARDS", ""},
    {"JOB_COMPLETION_INDEX", "", "", "PENCILSCAN_SHARDS", ""},
    {"AWS_BATCH_JOB_ARRAY_INDEX", "", "", "PENCILSCAN_SHARDS", ""},
    {"OMPI_COMM_WORLD_RANK", "", "", "OMPI_COMM_WORLD_SIZE", ""},
};

std::optional<long> whole_number(const std::string& text) {
  long value = 0;
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), value);
  if (error != std::errc() || end != text.data() + text.size()) return std::nullopt;
  return value;
}

std::optional<long> number_of(const Environment& environment, const char* name) {
  if (*name == '\0') return std::nullopt;
  const auto text = environment(name);
  return text ? whole_number(*text) : std::nullopt;
}

Shard from_scheduler(const Environment& environment) {
  for (const ArrayIndex& scheduler : kSchedulers) {
    const auto text = environment(scheduler.index);
    if (!text || text->empty() || *text == "undefined") continue;  // Grid Engine: no array
    const auto refuse = [&](const std::string& rule) {
      throw InputError("--shard", scheduler.index, *text, rule);
    };
    const auto index = whole_number(*text);
    if (!index) refuse("must be a whole number");
    const long first = number_of(environment, scheduler.first).value_or(0);
    const long step = number_of(environment, scheduler.step).value_or(1);
    std::optional<long> count = number_of(environment, scheduler.count);
    if (const auto last = number_of(environment, scheduler.last); !count && last && step > 0)
      count = (*last - first) / step + 1;
    if (!count || *count < 1) {
      refuse("the number of tasks is not known: set " +
             std::string(*scheduler.count == '\0' ? scheduler.last : scheduler.count) +
             " or give --shard i/n");
    }
    if (step < 1 || *index < first || (*index - first) % step != 0 ||
        (*index - first) / step >= *count)
      refuse("must be one of " + std::to_string(*count) + " tasks from " + std::to_string(first));
    return {static_cast<std::size_t>((*index - first) / step), static_cast<std::size_t>(*count)};
  }
  throw InputError("--shard", "", "auto",
                   "no scheduler says which task this is (SLURM_ARRAY_TASK_ID and the like): give "
                   "--shard i/n");
}

}  // namespace

std::vector<std::size_t> Shard::frames_of(std::size_t frames) const {
  std::vector<std::size_t> result;
  for (std::size_t i = 0; i < frames; ++i) {
    if (holds(i)) result.push_back(i);
  }
  return result;
}

std::size_t chunk_count(std::size_t frames) {
  return frames == 0 ? 1 : (frames + kChunkFrames - 1) / kChunkFrames;
}

Environment process_environment() {
  return [](const std::string& name) -> std::optional<std::string> {
    const char* value = std::getenv(name.c_str());
    return value == nullptr ? std::nullopt : std::optional<std::string>(value);
  };
}

Shard shard_from_text(const std::string& text, const Environment& environment) {
  if (text == "auto") return from_scheduler(environment);
  const auto slash = text.find('/');
  const auto index = whole_number(text.substr(0, slash));
  const auto count =
      slash == std::string::npos ? std::nullopt : whole_number(text.substr(slash + 1));
  if (!index || !count || *count < 1 || *index < 0 || *index >= *count)
    throw InputError("--shard", "", text, "must be i/n with 0 <= i < n, or auto");
  return {static_cast<std::size_t>(*index), static_cast<std::size_t>(*count)};
}

}  // namespace pencilscan
