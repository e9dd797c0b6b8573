#include <filesystem>
#include <iostream>
#include <memory>
#include <nlohmann/json.hpp>

#include "pencilscan/cli/command.h"
#include "pencilscan/cli/page_arguments.h"
#include "pencilscan/core/parallel.h"
#include "pencilscan/page/page.h"

namespace pencilscan::cli {
namespace {

namespace fs = std::filesystem;

struct ReportOptions {
  CommonOptions common;
  std::string folder;
  std::string out;
  double max_megabytes = 15;
  bool overwrite = false;
  PageOptions page;
};

void run_report(const ReportOptions& options) {
  const ThreadLimit limit(options.common.threads);
  PageOptions page = options.page;
  page.program = "pencilscan " PENCILSCAN_VERSION;
  page.max_bytes = static_cast<std::size_t>(options.max_megabytes * 1e6);
  const fs::path file =
      options.out.empty() ? fs::path(options.folder) / "report.html" : fs::path(options.out);
  refuse_existing("--out", file, options.overwrite);
  const PageReport report =
      write_report(options.folder, file, page, stderr_progress("nothing was written"));
  constexpr std::size_t kShown = 12;
  for (std::size_t i = 0; i < std::min(report.missing.size(), kShown); ++i)
    warn_of(report.missing[i]);
  if (report.missing.size() > kShown) {
    warn_of(std::to_string(report.missing.size() - kShown) + " more are listed in the report");
  }
  nlohmann::ordered_json figures;
  figures["results"] = report.results;
  figures["results_with_points_and_images"] = report.full_results;
  figures["megabytes"] = static_cast<double>(report.bytes) / 1e6;
  figures["report"] = file.string();
  print_figures(options.common, figures);
}

}  // namespace

void add_report_command(CLI::App& app) {
  auto options = std::make_shared<ReportOptions>();
  CLI::App* command = app.add_subcommand(
      "report", "One HTML file of an output folder, to look at in any browser and to mail.");
  command->add_option("--out", options->out, "the file; default: <folder>/report.html");
  add_overwrite(*command, options->overwrite, "Replace a report that is there");
  add_page_arguments(*command, options->folder, options->page);
  add_number(*command, "--max-size", options->max_megabytes, 1, 2000,
             "megabytes to aim at; of long sequences, some frames get points and images and "
             "the others their shape");
  add_common_options(*command, options->common, "pencilscan report result");
  command->callback([options] { run_report(*options); });
}

}  // namespace pencilscan::cli
