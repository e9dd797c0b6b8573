#include "pencilscan/cli/arguments.h"

#include "pencilscan/core/error.h"

namespace pencilscan::cli {

std::vector<std::string> listed_words(CLI::Option& option) {
  try {
    return words_of_either(option.get_validator(kWordsRule)->get_description());
  } catch (const CLI::OptionNotFound&) {
    return {};
  }
}

void refuse_existing(const std::string& option, const std::filesystem::path& file, bool overwrite) {
  std::error_code ignored;
  if (overwrite || !std::filesystem::exists(std::filesystem::symlink_status(file, ignored))) return;
  throw InputError("command line", option, file.string(),
                   "is there already: choose another name, or give --overwrite to replace it");
}

}  // namespace pencilscan::cli
