#include <fcntl.h>
#include <unistd.h>

#include <csignal>
#include <cstdlib>
#include <exception>
#include <iostream>
#include <memory>
#include <string>

#include "pencilscan/bundle/solver_messages.h"
#include "pencilscan/cli/command.h"
#include "pencilscan/cli/complaint.h"
#include "pencilscan/cli/help_format.h"
#include "pencilscan/core/error.h"
#include "pencilscan/core/memory.h"

namespace pencilscan::cli {
namespace {

enum ExitCode { kDone = 0, kStageFailed = 1, kBadInput = 2 };

void complain(const std::string& message) { std::cerr << "pencilscan: " << message << std::endl; }

int run(int argc, char** argv) {
  CLI::App app("One frame of a ring of cameras and projectors in, an entire 3-D shape out.",
               "pencilscan");
  app.formatter(std::make_shared<HelpFormat>());
  app.set_version_flag("-V,--version", "pencilscan " PENCILSCAN_VERSION, "Print the version");
  app.footer("Of one command: pencilscan rig ring --help");
  app.require_subcommand(1);
  app.fallthrough(false);
#include "registered_commands.inc"
  name_commands(app);
  if (const auto missing = missing_value(app, {argv + 1, argv + argc})) {
    complain(*missing);
    return kBadInput;
  }
  try {
    app.parse(argc, argv);
  } catch (const CLI::ParseError& error) {
    if (error.get_exit_code() == 0) return app.exit(error);  // --help, --version
    complain(complaint(app, error));
    return kBadInput;
  }
  std::cout.flush();
  if (!std::cout) throw StageError("standard output cannot be written");
  return kDone;
}

/// Where a standard file is closed, the next file that is opened would get its number, and what is
/// said on stderr would be written into it.
void open_standard_files() {
  for (const int file : {STDIN_FILENO, STDOUT_FILENO, STDERR_FILENO})
    if (::fcntl(file, F_GETFD) < 0 && ::open("/dev/null", O_RDWR) < 0) std::abort();
}

}  // namespace
}  // namespace pencilscan::cli

int main(int argc, char** argv) {
  using namespace pencilscan;
  cli::open_standard_files();
  keep_freed_memory();
  silence_solver_messages();
  // A write beyond the file size limit shall fail like a full disk instead of ending the program.
  std::signal(SIGXFSZ, SIG_IGN);
  try {
    return cli::run(argc, argv);
  } catch (const InputError& error) {
    cli::complain(error.what());
    return cli::kBadInput;
  } catch (const std::exception& error) {
    cli::complain(in_plain_words(error));
    return cli::kStageFailed;
  }
}
