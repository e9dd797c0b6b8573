#include "pencilscan/cli/arguments.h"

#include <memory>
#include <utility>

#include "pencilscan/cli/command.h"
#include "pencilscan/core/error.h"

namespace pencilscan::cli {

std::vector<std::string> listed_words(CLI::Option& option) {
  try {
    return words_of_either(option.get_validator(kWordsRule)->get_description());
  } catch (const CLI::OptionNotFound&) {
    return {};
  }
}

CLI::Validator only_where(std::function<bool()> holds, const std::string& rule) {
  return {[=](std::string&) { return holds() ? std::string() : rule; }, ""};
}

CLI::Validator told_where_not(const std::string& option, std::function<bool()> holds,
                              const std::string& rule) {
  const auto told = std::make_shared<bool>(false);
  return {[=](std::string&) {
            if (!holds() && !std::exchange(*told, true))
              warn_of(option + " has no effect here: it " + rule);
            return std::string();
          },
          ""};
}

void excludes_all_but(CLI::App& command, CLI::Option& option, const std::set<std::string>& used) {
  const std::set<std::string> common{"--help", "--threads", "--seed", "--json"};
  for (CLI::Option* other : command.get_options()) {
    const std::string name = other->get_name();
    if (other != &option && !common.contains(name) && !used.contains(name)) option.excludes(other);
  }
}

void refuse_existing(const std::string& option, const std::filesystem::path& file, bool overwrite) {
  std::error_code ignored;
  if (overwrite || !std::filesystem::exists(std::filesystem::symlink_status(file, ignored))) return;
  throw InputError("command line", option, file.string(),
                   "is there already: choose another name, or give --overwrite to replace it");
}

}  // namespace pencilscan::cli
