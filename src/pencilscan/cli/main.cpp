#include <algorithm>
#include <csignal>
#include <exception>
#include <iostream>
#include <string>

#include "pencilscan/cli/command.h"
#include "pencilscan/core/error.h"
#include "pencilscan/core/memory.h"

namespace pencilscan::cli {
namespace {

enum ExitCode { kDone = 0, kStageFailed = 1, kBadInput = 2 };

void complain(const std::string& message) { std::cerr << "pencilscan: " << message << std::endl; }

/// CLI11's complaints may have several lines; the first one says it all.
std::string first_line(const std::string& text) { return text.substr(0, text.find('\n')); }

int run(int argc, char** argv) {
  CLI::App app("One frame of a ring of cameras and projectors in, an entire 3-D shape out.",
               "pencilscan");
  app.set_version_flag("--version", "pencilscan " PENCILSCAN_VERSION);
  app.require_subcommand(1);
  app.fallthrough(false);
#include "registered_commands.inc"
  try {
    app.parse(argc, argv);
  } catch (const CLI::ParseError& error) {
    if (error.get_exit_code() == 0) return app.exit(error);  // --help, --version
    // CLI11 says of an unknown command only that it misses a known one.
    const auto commands = app.get_subcommands([](const CLI::App*) { return true; });
    const bool unknown =
        argc > 1 && argv[1][0] != '-' &&
        std::none_of(commands.begin(), commands.end(),
                     [&](const CLI::App* command) { return command->get_name() == argv[1]; });
    complain((unknown ? std::string("unknown command ") + argv[1] : first_line(error.what())) +
             " (see pencilscan --help)");
    return kBadInput;
  }
  std::cout.flush();
  if (!std::cout) throw StageError("standard output cannot be written");
  return kDone;
}

}  // namespace
}  // namespace pencilscan::cli

int main(int argc, char** argv) {
  using namespace pencilscan;
  keep_freed_memory();
  // A write beyond the file size limit shall fail like a full disk instead of ending the program.
  std::signal(SIGXFSZ, SIG_IGN);
  try {
    return cli::run(argc, argv);
  } catch (const InputError& error) {
    cli::complain(error.what());
    return cli::kBadInput;
  } catch (const std::exception& error) {
    cli::complain(error.what());
    return cli::kStageFailed;
  }
}
