#include "pencilscan/cli/complaint.h"

#include <algorithm>
#include <optional>
#include <regex>
#include <vector>

#include "pencilscan/cli/help_format.h"
#include "pencilscan/cli/spelling.h"

namespace pencilscan::cli {
namespace {

/// The command that the words have led to.
const CLI::App& last_command(const CLI::App& program) {
  const CLI::App* command = &program;
  while (!command->get_subcommands().empty()) command = command->get_subcommands().back();
  return *command;
}

/// "pencilscan rig ring".
std::string words_of(const CLI::App& command) {
  const CLI::App* above = command.get_parent();
  return (above == nullptr ? "" : words_of(*above) + " ") + command.get_name();
}

std::string see_help_of(const CLI::App& command) {
  return " (see " + words_of(command) + " --help)";
}

std::vector<const CLI::App*> commands_of(const CLI::App& command) {
  return command.get_subcommands([](const CLI::App*) { return true; });
}

std::vector<std::string> command_names(const CLI::App& command) {
  std::vector<std::string> names;
  for (const CLI::App* below : commands_of(command))
    if (!is_hidden(*below)) names.push_back(below->get_name());
  return names;
}

std::vector<std::string> option_names(const CLI::App& command) {
  std::vector<std::string> names;
  for (const CLI::Option* option : command.get_options())
    for (const std::string& name : option->get_lnames()) names.push_back("--" + name);
  return names;
}

/// "ring" -> "rig ring", where another command has a command of this name.
std::optional<std::string> command_elsewhere(const CLI::App& command, const std::string& word) {
  const CLI::App* program = &command;
  while (program->get_parent() != nullptr) program = program->get_parent();
  for (const CLI::App* first : commands_of(*program)) {
    if (first->get_name() == word) return word;
    for (const CLI::App* second : commands_of(*first))
      if (second->get_name() == word) return first->get_name() + " " + word;
  }
  return std::nullopt;
}

std::string unknown_command(const CLI::App& command, const std::string& word) {
  const std::string what = "unknown command " + word;
  if (const auto elsewhere = command_elsewhere(command, word))
    return what + "; did you mean " + *elsewhere + "?";
  const auto names = command_names(command);
  const std::string guess = did_you_mean(word, names);
  return what + (guess.empty() ? ": must be " + either(names) : guess);
}

std::string unknown_option(const CLI::App& command, const std::string& word) {
  const std::string name = word.substr(0, word.find('='));
  if (!commands_of(command).empty())
    return "unknown option " + name + ": options stand behind the command that they belong to";
  return "unknown option " + name + did_you_mean(name, option_names(command));
}

/// The first word that no command and no option took.
std::optional<std::string> stray_word(const CLI::App& command) {
  const std::vector<std::string> words = command.remaining();
  if (words.empty()) return std::nullopt;
  // A value that stands behind an unknown option is stray only with it.
  const auto option = std::find_if(words.begin(), words.end(), [](const std::string& word) {
    return word.size() > 1 && word[0] == '-';
  });
  if (option != words.end() && (commands_of(command).empty() || option == words.begin()))
    return unknown_option(command, *option);
  if (!commands_of(command).empty()) return unknown_command(command, words.front());
  return "unexpected word " + words.front() + ": no option takes it (quote values with spaces)";
}

/// What the library says, as "name: text".
std::string after_name(const std::string& message) {
  const auto colon = message.find(": ");
  return colon == std::string::npos ? message : message.substr(colon + 2);
}

std::string wrong_count(const CLI::App& command, const std::string& message) {
  for (const CLI::Option* option : command.get_options()) {
    const std::string name = option->get_name();
    if (!message.starts_with(name + ":")) continue;
    const int wanted = option->get_expected_min();
    if (option->results().size() > static_cast<std::size_t>(option->get_expected_max()))
      return name + " stands more than once";
    return name + (wanted > 1 ? " needs " + std::to_string(wanted) + " values" : " needs a value");
  }
  return message;
}

std::string in_words(const CLI::App& command, const CLI::ParseError& error) {
  const std::string text = error.what();
  const std::string message = text.substr(0, text.find('\n'));
  if (dynamic_cast<const CLI::ArgumentMismatch*>(&error) != nullptr)
    return wrong_count(command, message);
  if (dynamic_cast<const CLI::ValidationError*>(&error) != nullptr)
    return message.substr(0, message.find(": ")) + " " + after_name(message);  // "= 7: must be"
  if (dynamic_cast<const CLI::ExcludesError*>(&error) != nullptr)
    return std::regex_replace(message, std::regex(" excludes "), " and ") + " do not go together";
  if (dynamic_cast<const CLI::RequiredError*>(&error) != nullptr && !commands_of(command).empty()) {
    return (command.get_parent() == nullptr ? "a command is missing: " : "what is to be done? ") +
           either(command_names(command));
  }
  return message;
}

}  // namespace

std::string complaint(const CLI::App& program, const CLI::ParseError& error) {
  const CLI::App& command = last_command(program);
  for (const CLI::App* at = &command; at != nullptr; at = at->get_parent())
    if (const auto stray = stray_word(*at)) return *stray + see_help_of(command);
  return in_words(command, error) + see_help_of(command);
}

std::optional<std::string> missing_value(const CLI::App& program,
                                         const std::vector<std::string>& words) {
  // An unset variable of a script, in quotes. No option means something by an empty value, and as a
  // folder it would be the current one.
  for (std::size_t i = 0; i < words.size(); ++i) {
    const bool ends_so = words[i].starts_with("--") && words[i].find('=') == words[i].size() - 1;
    if (!words[i].empty() && !ends_so) continue;
    if (ends_so) return words[i] + " needs a value behind the =";
    return i > 0 && words[i - 1].starts_with("-")
               ? words[i - 1] + " needs a value, and the word behind it is empty"
               : "word " + std::to_string(i + 1) + " is empty";
  }
  const CLI::App* command = &program;
  for (std::size_t i = 0; i + 1 < words.size(); ++i) {
    for (const CLI::App* below : commands_of(*command))
      if (below->get_name() == words[i]) command = below;
    const CLI::Option* option = command->get_option_no_throw(words[i]);
    const bool takes_value = words[i].starts_with("--") && option != nullptr &&
                             option->get_type_size() > 0 && option->get_expected_min() > 0;
    if (takes_value && words[i + 1].starts_with("--") &&
        command->get_option_no_throw(words[i + 1]) != nullptr)
      return words[i] + " needs a value, not " + words[i + 1] + see_help_of(*command);
  }
  return std::nullopt;
}

}  // namespace pencilscan::cli
