#include <algorithm>
#include <cctype>
#include <filesystem>
#include <iostream>
#include <memory>
#include <string>

#include "pencilscan/cli/command.h"
#include "pencilscan/cli/command_table.h"
#include "pencilscan/cli/help_format.h"
#include "pencilscan/core/name_list.h"
#include "pencilscan/io/file.h"

// Man pages in the macros of man(7), from the same tables as help: one of the program and one of
// each command, named as pencilscan-rig-ring.1.

namespace pencilscan::cli {
namespace {

/// Text in which nothing is markup, and a dash is the one to type.
std::string roff(const std::string& text) {
  std::string safe;
  for (const char letter : text) {
    if (letter == '\\')
      safe += "\\e";
    else if (letter == '-')
      safe += "\\-";
    else
      safe += letter;
  }
  return safe.starts_with('.') || safe.starts_with('\'') ? "\\&" + safe : safe;
}

std::string lines(const std::string& text) {
  std::string all;
  std::size_t begin = 0;
  while (begin < text.size()) {
    const auto end = std::min(text.find('\n', begin), text.size());
    const auto first = text.find_first_not_of(' ', begin);
    if (first < end) all += roff(text.substr(first, end - first)) + "\n";
    begin = end + 1;
  }
  return all;
}

std::string bold(const std::string& text) { return "\\fB" + roff(text) + "\\fR"; }
std::string italic(const std::string& text) { return "\\fI" + roff(text) + "\\fR"; }

std::string options_section(const CommandEntry& command) {
  std::string arguments;
  std::string options;
  for (const OptionEntry& option : command.options) {
    std::string names;
    for (const std::string& name : option.names)
      add_name(names, option.is_argument ? italic(name) : bold(name));
    if (!option.is_argument && option.takes_value()) names += " " + italic(option.takes);
    (option.is_argument ? arguments : options) += ".TP\n" + names + "\n" + lines(option.text);
  }
  return (arguments.empty() ? "" : ".SH ARGUMENTS\n" + arguments) + ".SH OPTIONS\n" + options;
}

std::string synopsis(const CommandEntry& command) {
  std::string text = ".B " + roff(command.name()) + "\n[options]";
  if (!command.commands.empty()) text += " " + italic("command");
  for (const OptionEntry& option : command.options)
    if (option.is_argument) text += " " + italic(option.names.front());
  return text + "\n";
}

/// The commands below `command`, each with what its page begins with.
std::string commands_section(const CommandEntry& command, const std::vector<CommandEntry>& table) {
  std::string text = ".SH COMMANDS\n";
  for (const CommandEntry& entry : table) {
    const bool is_below = entry.path.size() == command.path.size() + 1 &&
                          std::equal(command.path.begin(), command.path.end(), entry.path.begin());
    if (is_below) text += ".TP\n.BR " + roff(entry.name("-")) + " (1)\n" + lines(entry.text);
  }
  return text;
}

/// "Example:\n  text" as a section.
std::string example_section(const std::string& footer) {
  const std::string heading = "Example:\n";
  if (!footer.starts_with(heading)) return "";
  return ".SH EXAMPLE\n.nf\n" + lines(footer.substr(heading.size())) + ".fi\n";
}

std::string see_also(const CommandEntry& command) {
  std::string above = "pencilscan";
  std::string text = ".SH SEE ALSO\n";
  for (std::size_t i = 0; i + 1 < command.path.size(); ++i) {
    text += ".BR " + roff(above) + " (1),\n";
    above += "-" + command.path[i];
  }
  if (!command.path.empty()) text += ".BR " + roff(above) + " (1)\n.PP\n";
  return text + "All documents: /usr/share/doc/pencilscan\\-doc (package pencilscan\\-doc)\n";
}

constexpr const char* kExitStatus =
    ".SH EXIT STATUS\n"
    ".TP\n0\nDone.\n"
    ".TP\n1\nA stage could not give a result.\n"
    ".TP\n2\nThe input or the command line is wrong; one line on standard error says what to do.\n";

std::string page(const CommandEntry& command, const std::vector<CommandEntry>& table) {
  std::string title = command.name("-");
  for (char& letter : title) letter = static_cast<char>(std::toupper(letter));
  std::string text = ".TH " + roff(title) +
                     " 1 \"\" \"pencilscan " PENCILSCAN_VERSION "\" \"pencilscan\"\n.SH NAME\n" +
                     roff(command.name("-")) + " \\- " + roff(without_dot(command.text)) +
                     "\n.SH SYNOPSIS\n" + synopsis(command);
  if (!command.commands.empty()) text += commands_section(command, table);
  return text + options_section(command) + kExitStatus + example_section(command.footer) +
         see_also(command);
}

}  // namespace

void add_manual_command(CLI::App& app) {
  auto folder = std::make_shared<std::string>();
  CLI::App* command = app.add_subcommand("manual", "Write a man page of each command");
  hide(*command);
  command->add_option("folder", *folder, "the folder for them")->required();
  command->footer("Example:\n  pencilscan manual man1");
  command->callback([folder, &app] {
    const std::vector<CommandEntry> table = command_table(app);
    for (const CommandEntry& entry : table)
      write_text(std::filesystem::path(*folder) / (entry.name("-") + ".1"), page(entry, table));
    std::cout << table.size() << " pages\n";
  });
}

}  // namespace pencilscan::cli
