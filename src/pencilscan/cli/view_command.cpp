#include <pthread.h>

#include <csignal>
#include <iostream>
#include <memory>
#include <nlohmann/json.hpp>
#include <thread>

#include "pencilscan/cli/command.h"
#include "pencilscan/cli/page_arguments.h"
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
  // Signals are waited for by a thread of their own; all others, made from here on, ignore them.
  sigset_t signals;
  sigemptyset(&signals);
  sigaddset(&signals, SIGINT);
  sigaddset(&signals, SIGTERM);
  pthread_sigmask(SIG_BLOCK, &signals, nullptr);
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
  std::cerr << "pencilscan: open " << server.link() << " in a browser; Ctrl-C stops\n";
  std::thread waiting([&] {
    int signal = 0;
    sigwait(&signals, &signal);
    server.stop();
  });
  server.run();
  pthread_kill(waiting.native_handle(), SIGTERM);  // when run() ended by itself
  waiting.join();
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
