#pragma once

#include <CLI/CLI.hpp>
#include <string>

namespace pencilscan::cli {

/// Help in the words of people who use a program rather than of those who write one: of each option
/// what it takes (TEXT, NUMBER), what it does, which values it may have and which it has without.
class HelpFormat : public CLI::Formatter {
 public:
  HelpFormat();
  std::string make_option_opts(const CLI::Option* option) const override;
  std::string make_option_desc(const CLI::Option* option) const override;
};

/// Commands for programs, such as the one that writes man pages, are not in help: hide() makes one
/// so.
void hide(CLI::App& command);
[[nodiscard]] bool is_hidden(const CLI::App& command);

/// Lists the commands below as commands, and theirs.
void name_commands(CLI::App& command);

}  // namespace pencilscan::cli
