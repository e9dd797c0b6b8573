#include "pencilscan/cli/command_table.h"

#include "pencilscan/cli/arguments.h"
#include "pencilscan/cli/help_format.h"

namespace pencilscan::cli {
namespace {

std::string without_spaces_before(const std::string& text) {
  const auto begin = text.find_first_not_of(' ');
  return begin == std::string::npos ? "" : text.substr(begin);
}

OptionEntry entry_of(CLI::Option& option) {
  const HelpFormat format;
  OptionEntry entry;
  entry.is_argument = option.get_positional();
  if (entry.is_argument) {
    entry.names.push_back(option.get_name(true));
  } else {
    for (const std::string& name : option.get_snames()) entry.names.push_back("-" + name);
    for (const std::string& name : option.get_lnames()) entry.names.push_back("--" + name);
  }
  entry.takes = without_spaces_before(format.make_option_opts(&option));
  entry.text = format.make_option_desc(&option);
  entry.words = listed_words(option);
  return entry;
}

void add_entries(CLI::App& command, std::vector<std::string> path,
                 std::vector<CommandEntry>& table) {
  CommandEntry entry{path, command.get_description(), command.get_footer(), {}, {}};
  for (CLI::Option* option : command.get_options()) entry.options.push_back(entry_of(*option));
  const auto below = command.get_subcommands([](const CLI::App* app) { return !is_hidden(*app); });
  for (const CLI::App* app : below) entry.commands.push_back(app->get_name());
  table.push_back(std::move(entry));
  for (CLI::App* app : below) {
    path.push_back(app->get_name());
    add_entries(*app, path, table);
    path.pop_back();
  }
}

}  // namespace

std::string CommandEntry::name(const std::string& separator) const {
  std::string words = "pencilscan";
  for (const std::string& word : path) words += separator + word;
  return words;
}

std::vector<CommandEntry> command_table(CLI::App& program) {
  std::vector<CommandEntry> table;
  add_entries(program, {}, table);
  return table;
}

std::string without_dot(const std::string& text) {
  return text.ends_with('.') ? text.substr(0, text.size() - 1) : text;
}

}  // namespace pencilscan::cli
