#include <iostream>
#include <memory>
#include <nlohmann/json.hpp>

#include "pencilscan/cli/command.h"
#include "pencilscan/cli/page_arguments.h"
#include "pencilscan/cli/serve.h"
#include "pencilscan/core/parallel.h"
#include "pencilscan/server/view_server.h"

namespace pencilscan::cli {
namespace {

struct ViewCommandOptions {
  CommonOptions common;
  std::string folder;
  ViewOptions view;
};

void run_view(const ViewCommandOptions& options) {
  Interruption interruption;  // before any thread
  const ThreadLimit limit(options.common.threads);
  ViewOptions view = options.view;
  view.page.program = "pencilscan " PENCILSCAN_VERSION;
  ViewServer server(options.folder, view);
  nlohmann::ordered_json figures;
  figures["results"] = server.results();
  figures["address"] = server.link();
  print_figures(options.common, figures);
  std::cout.flush();
  if (view.address != ViewOptions{}.address) {
    warn_of(
        "other computers reach this page, and what they read is not encrypted; only who knows "
        "the link gets an answer");
  }
  serve(server, interruption);
}

}  // namespace

void add_view_command(CLI::App& app) {
  auto options = std::make_shared<ViewCommandOptions>();
  CLI::App* command = app.add_subcommand(
      "view", "The report with the full data, for a browser on this computer (Ctrl-C stops).");
  command
      ->add_option("--listen", options->view.address,
                   "address of this computer to listen on; with another one than the default, "
                   "other computers reach the page")
      ->capture_default_str();
  add_number(*command, "--port", options->view.port, 0, 65535, "0: any free one");
  add_page_arguments(*command, options->folder, options->view.page);
  add_common_options(*command, options->common, "pencilscan view result");
  command->callback([options] { run_view(*options); });
}

}  // namespace pencilscan::cli
