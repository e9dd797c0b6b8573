#pragma once

#include <span>
#include <string>

#include "pencilscan/jobs/job_folder.h"

namespace pencilscan {

/// The two scripts that Slurm gets: all tasks as one array, each put back in the queue when its
/// node fails (--requeue), at most `limit` at once; and `sequence finish`, which runs when all have
/// ended, however they did. `rounds`: how often that may submit what is missing once more.
struct SlurmScripts {
  std::string array;
  std::string finish;
};
[[nodiscard]] SlurmScripts slurm_scripts(const Job& job, std::span<const std::size_t> tasks,
                                         int rounds);

/// What Slurm calls the jobs.
struct SlurmJobs {
  std::string array;
  std::string finish;
};

/// Writes the scripts into the job folder and hands them to sbatch. StageError with what it says
/// when it takes them not.
[[nodiscard]] SlurmJobs submit_to_slurm(const Job& job, std::span<const std::size_t> tasks,
                                        int rounds);

/// "0-6" or "2,5,7-9", as --array takes it.
[[nodiscard]] std::string index_list(std::span<const std::size_t> indices);

}  // namespace pencilscan
