#include "layering.h"

#include <algorithm>
#include <fstream>
#include <map>
#include <regex>

namespace pencilscan {
namespace {

namespace fs = std::filesystem;

/// The module that an #include line names; empty for any other line.
std::string included_module(const std::string& line) {
  static const std::regex include(R"re(^\s*#\s*include\s*["<]pencilscan/([^/">]+)/.*)re");
  std::smatch match;
  return std::regex_match(line, match, include) ? match[1].str() : std::string();
}

bool contains(const std::vector<std::string>& names, const std::string& name) {
  return std::find(names.begin(), names.end(), name) != names.end();
}

/// What is wrong with a file of `from` that includes `to`; empty when nothing is.
std::string verdict(const LayeringRules& rules, const std::string& from, const std::string& to,
                    bool is_test) {
  const auto layer_of = [&rules](const std::string& module) {
    return std::find(rules.layers.begin(), rules.layers.end(), module);
  };
  if (layer_of(to) == rules.layers.end()) return "includes " + to + ", which is no layer";
  if (layer_of(to) > layer_of(from)) return from + " includes " + to + ", which lies above it";
  if (!is_test && to == rules.oracle && contains(rules.judged, from)) {
    return from + " includes " + to + ", its oracle";
  }
  return {};
}

void check_file(const fs::path& path, const std::string& module, const LayeringRules& rules,
                std::vector<std::string>& violations) {
  const std::string name = path.filename().string();
  const bool is_test = name.ends_with("_test.cpp");
  std::ifstream file(path);
  std::string line;
  for (int number = 1; std::getline(file, line); ++number) {
    const std::string to = included_module(line);
    if (to.empty()) continue;
    const std::string wrong = verdict(rules, module, to, is_test);
    if (wrong.empty()) continue;
    violations.push_back(module + "/" + name + ":" + std::to_string(number) + ": " + wrong);
  }
}

}  // namespace

std::vector<std::string> layering_violations(const fs::path& source_root,
                                             const LayeringRules& rules) {
  std::vector<std::string> violations;
  for (const fs::directory_entry& folder : fs::directory_iterator(source_root)) {
    if (!folder.is_directory()) continue;
    const std::string module = folder.path().filename().string();
    if (!contains(rules.layers, module)) {
      violations.push_back(module + ": is no layer");
      continue;
    }
    for (const fs::directory_entry& entry : fs::recursive_directory_iterator(folder)) {
      const std::string extension = entry.path().extension().string();
      if (extension == ".h" || extension == ".cpp") {
        check_file(entry.path(), module, rules, violations);
      }
    }
  }
  std::sort(violations.begin(), violations.end());
  return violations;
}

std::vector<std::string> repeated_types(const fs::path& source_root) {
  static const std::regex definition(R"re(^(?:struct|class|enum class) (\w+)[^;]*\{.*)re");
  std::map<std::string, std::vector<std::string>> headers;
  for (const fs::directory_entry& entry : fs::recursive_directory_iterator(source_root)) {
    if (entry.path().extension() != ".h") continue;
    std::ifstream file(entry.path());
    std::smatch match;
    for (std::string line; std::getline(file, line);) {
      if (std::regex_match(line, match, definition))
        headers[match[1]].push_back(fs::relative(entry.path(), source_root).generic_string());
    }
  }
  std::vector<std::string> repeated;
  for (auto& [type, files] : headers) {
    std::sort(files.begin(), files.end());
    for (std::size_t i = 1; i < files.size(); ++i)
      repeated.push_back(type + ": " + files[i - 1] + " and " + files[i]);
  }
  return repeated;
}

}  // namespace pencilscan
