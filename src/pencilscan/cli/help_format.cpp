#include "pencilscan/cli/help_format.h"

namespace pencilscan::cli {
namespace {

/// What an option takes and its rule, which the library keeps in one text: "INT:from 1 to 256".
struct Value {
  std::string kind;
  std::string rule;
};

Value value_of(const CLI::Option& option) {
  const std::string text = option.get_type_name();
  const auto colon = text.find(':');
  Value value{text.substr(0, colon), colon == std::string::npos ? "" : text.substr(colon + 1)};
  if (value.kind == "INT" || value.kind == "UINT" || value.kind == "FLOAT") value.kind = "NUMBER";
  if (value.kind == "ENUM") value.kind = "TEXT";
  return value;
}

/// The library puts lists into brackets, which nobody is to type.
std::string default_of(const CLI::Option& option) {
  const std::string text = option.get_default_str();
  const bool is_list = text.size() > 1 && text.front() == '[' && text.back() == ']';
  return is_list ? text.substr(1, text.size() - 2) : text;
}

}  // namespace

HelpFormat::HelpFormat() {
  column_width(32);
  label("SUBCOMMAND", "COMMAND");
  label("OPTIONS", "options");
  label("Positionals", "Arguments");
}

std::string HelpFormat::make_option_opts(const CLI::Option* option) const {
  if (option->get_type_size() == 0) return "";
  const std::string kind = value_of(*option).kind;
  std::string text;
  for (int i = 0; i < option->get_expected_min(); ++i) text += " " + kind;
  if (option->get_expected_max() == CLI::detail::expected_max_vector_size) text += " ...";
  return text;
}

std::string HelpFormat::make_option_desc(const CLI::Option* option) const {
  std::string text = option->get_description();
  const auto add = [&](const std::string& more) { text += (text.empty() ? "" : "; ") + more; };
  if (option->get_type_size() != 0) {
    const Value value = value_of(*option);
    if (!value.rule.empty()) add(value.rule);
    if (const std::string fallback = default_of(*option); !fallback.empty())
      add("default " + fallback);
    if (option->get_required()) add("required");
  }
  for (const CLI::Option* needed : option->get_needs()) add("with " + needed->get_name());
  return text;
}

void hide(CLI::App& command) { command.group(""); }  // the library's sign of it

bool is_hidden(const CLI::App& command) { return command.get_group().empty(); }

void name_commands(CLI::App& command) {
  for (CLI::App* below :
       command.get_subcommands([](const CLI::App* app) { return !is_hidden(*app); })) {
    below->group("Commands");
    name_commands(*below);
  }
}

}  // namespace pencilscan::cli
