#pragma once

#include <CLI/CLI.hpp>
#include <string>
#include <vector>

namespace pencilscan::cli {

/// An option or an argument, in the words of help.
struct OptionEntry {
  std::vector<std::string> names;  ///< "-h", "--help"; of an argument its name alone
  std::string takes;               ///< "TEXT", "NUMBER ..."; nothing for a flag
  std::string text;                ///< what it does, its rule and its default
  std::vector<std::string> words;  ///< the values that it may have, where they are words
  bool is_argument = false;        ///< stands without a name

  [[nodiscard]] bool takes_value() const { return !takes.empty(); }
  [[nodiscard]] bool takes_number() const { return takes.starts_with("NUMBER"); }
};

/// A command, as man pages and completion tell of it.
struct CommandEntry {
  std::vector<std::string> path;  ///< "rig", "ring"; nothing for the program itself
  std::string text;               ///< what it does
  std::string footer;             ///< the example
  std::vector<OptionEntry> options;
  std::vector<std::string> commands;  ///< names of the commands below it

  /// "pencilscan rig ring".
  [[nodiscard]] std::string name(const std::string& separator = " ") const;
};

/// The program and all its commands, those above before those below, as help lists them.
[[nodiscard]] std::vector<CommandEntry> command_table(CLI::App& program);

/// "Write a ring" of "Write a ring.": texts of commands are sentences with or without their dot.
[[nodiscard]] std::string without_dot(const std::string& text);

}  // namespace pencilscan::cli
