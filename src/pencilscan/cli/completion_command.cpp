#include <algorithm>
#include <iostream>
#include <map>
#include <memory>
#include <string>
#include <vector>

#include "pencilscan/cli/command.h"
#include "pencilscan/cli/command_table.h"
#include "pencilscan/cli/help_format.h"

// Scripts for bash and zsh that complete commands, options and the values that are words, from the
// same tables as help.

namespace pencilscan::cli {
namespace {

std::string joined(const std::vector<std::string>& words, const std::string& separator) {
  std::string text;
  for (const std::string& word : words) text += (text.empty() ? "" : separator) + word;
  return text;
}

/// "rig ring"; nothing for the program itself.
std::string words_of_path(const CommandEntry& command) { return joined(command.path, " "); }

// ---- bash ---------------------------------------------------------------------------------------

/// What may stand next: commands and options of each command.
std::string bash_words(const std::vector<CommandEntry>& table) {
  std::string text;
  for (const CommandEntry& command : table) {
    std::vector<std::string> words = command.commands;
    for (const OptionEntry& option : command.options)
      if (!option.is_argument) words.push_back(option.names.back());
    text += "    '" + words_of_path(command) + "') words='" + joined(words, " ") + "' ;;\n";
  }
  return text;
}

/// What may stand behind an option: its words, a number, or a file.
std::string bash_values(const std::vector<CommandEntry>& table) {
  std::map<std::string, std::vector<std::string>> cases;  // by what is done
  for (const CommandEntry& command : table) {
    for (const OptionEntry& option : command.options) {
      if (option.is_argument || !option.takes_value()) continue;
      std::string action = "files=yes";
      if (option.takes_number()) action = "words=";
      if (!option.words.empty()) action = "words='" + joined(option.words, " ") + "'";
      cases[action].push_back("'" + words_of_path(command) + " " + option.names.back() + "'");
    }
  }
  std::string text;
  for (const auto& [action, options] : cases)
    text += "    " + joined(options, " | \\\n    ") + ") " + action + " ;;\n";
  return text;
}

/// Commands whose arguments are files.
std::string bash_arguments(const std::vector<CommandEntry>& table) {
  std::vector<std::string> commands;
  for (const CommandEntry& command : table)
    for (const OptionEntry& option : command.options)
      if (option.is_argument) commands.push_back("'" + words_of_path(command) + "'");
  return "    " + joined(commands, " | ") + ") [[ $word == -* ]] || files=yes ;;\n";
}

std::string bash_commands(const std::vector<CommandEntry>& table) {
  std::vector<std::string> all;
  for (const CommandEntry& command : table)
    if (!command.path.empty()) all.push_back("'" + words_of_path(command) + "'");
  return "      " + joined(all, " | \\\n      ") + ")\n";
}

std::string bash_script(const std::vector<CommandEntry>& table) {
  return "# Completion of pencilscan " PENCILSCAN_VERSION
         " for bash, as `pencilscan completion bash` writes it.\n"
         "_pencilscan() {\n"
         "  local word=${COMP_WORDS[COMP_CWORD]} before=${COMP_WORDS[COMP_CWORD-1]}\n"
         "  local command='' words='' files='' i longer\n"
         "  # bash takes --option=value for three words.\n"
         "  if [[ $word == '=' ]]; then\n"
         "    word=''\n"
         "  elif [[ $before == '=' ]]; then\n"
         "    before=${COMP_WORDS[COMP_CWORD-2]}\n"
         "  fi\n"
         "  for ((i = 1; i < COMP_CWORD; ++i)); do\n"
         "    longer=\"$command ${COMP_WORDS[i]}\"\n"
         "    longer=${longer# }\n"
         "    case $longer in\n" +
         bash_commands(table) +
         "        command=$longer ;;\n"
         "      *) break ;;\n"
         "    esac\n"
         "  done\n"
         "  case $command in\n" +
         bash_words(table) +
         "  esac\n"
         "  case $command in\n" +
         bash_arguments(table) +
         "  esac\n"
         "  case \"$command $before\" in\n" +
         bash_values(table) +
         "  esac\n"
         "  COMPREPLY=()\n"
         "  if [[ $files ]]; then\n"
         "    compopt -o default 2>/dev/null\n"
         "  else\n"
         "    COMPREPLY=($(compgen -W \"$words\" -- \"$word\"))\n"
         "  fi\n"
         "}\n"
         "complete -F _pencilscan pencilscan\n";
}

// ---- zsh ----------------------------------------------------------------------------------------

/// Text between single quotes; `special` letters of _arguments get a backslash.
std::string zsh_text(const std::string& text, const std::string& special) {
  std::string safe;
  for (const char letter : text) {
    if (letter == '\'')
      safe += "'\\''";
    else if (special.find(letter) != std::string::npos)
      safe += std::string("\\") + letter;
    else
      safe += letter;
  }
  return safe;
}

/// ":what:action" of a value.
std::string zsh_value(const OptionEntry& option) {
  if (!option.words.empty()) return ":word:(" + joined(option.words, " ") + ")";
  return option.takes_number() ? ":number: " : ":file:_files";
}

std::string zsh_option(const OptionEntry& option) {
  if (option.is_argument) return "'*:file:_files'";
  const std::string text = "[" + zsh_text(option.text, "[]\\") + "]";
  if (!option.takes_value()) {
    if (option.names.size() == 1) return "'" + option.names.front() + text + "'";
    return "'(" + joined(option.names, " ") + ")'{" + joined(option.names, ",") + "}'" + text + "'";
  }
  const std::string repeated = option.takes.ends_with("...") ? "*" : "";
  return "'" + repeated + option.names.back() + "=" + text + zsh_value(option) + "'";
}

std::string zsh_function(const CommandEntry& command, const std::vector<CommandEntry>& table) {
  const std::string name = "_" + command.name("_");
  std::string text = name + "() {\n";
  std::string choices;
  std::string calls;
  for (const CommandEntry& below : table) {
    if (below.path.size() != command.path.size() + 1 ||
        !std::equal(command.path.begin(), command.path.end(), below.path.begin()))
      continue;
    const std::string& word = below.path.back();
    choices += "    '" + word + ":" + zsh_text(without_dot(below.text), "\\:") + "'\n";
    calls += "        " + word + ") _" + below.name("_") + " ;;\n";
  }
  if (!choices.empty()) {
    text += "  local context state state_descr line\n  typeset -A opt_args\n";
    text += "  local -a commands=(\n" + choices + "  )\n";
  }
  text += choices.empty() ? "  _arguments" : "  _arguments -C";
  for (const OptionEntry& option : command.options) text += " \\\n    " + zsh_option(option);
  if (!choices.empty()) {
    text +=
        " \\\n    '1:command:->command' '*::argument:->argument'\n"
        "  case $state in\n"
        "    command) _describe command commands ;;\n"
        "    argument)\n"
        "      case $words[1] in\n" +
        calls +
        "      esac ;;\n"
        "  esac";
  }
  return text + "\n}\n";
}

std::string zsh_script(const std::vector<CommandEntry>& table) {
  std::string text =
      "#compdef pencilscan\n"
      "# Completion of pencilscan " PENCILSCAN_VERSION
      " for zsh, as `pencilscan completion zsh` writes it.\n";
  for (const CommandEntry& command : table) text += zsh_function(command, table);
  return text +
         "if [[ $funcstack[1] == _pencilscan ]]; then\n  _pencilscan \"$@\"\n"
         "else\n  compdef _pencilscan pencilscan\nfi\n";
}

}  // namespace

void add_completion_command(CLI::App& app) {
  auto shell = std::make_shared<std::string>();
  CLI::App* command =
      app.add_subcommand("completion", "Print what completes commands and options in a shell");
  hide(*command);
  command->add_option("shell", *shell, "the shell")->check(one_of({"bash", "zsh"}))->required();
  command->footer("Example:\n  source <(pencilscan completion bash)");
  command->callback([shell, &app] {
    const std::vector<CommandEntry> table = command_table(app);
    std::cout << (*shell == "bash" ? bash_script(table) : zsh_script(table));
  });
}

}  // namespace pencilscan::cli
