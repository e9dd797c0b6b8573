#pragma once

#include <filesystem>
#include <string>
#include <vector>

namespace pencilscan {

/// The rules of docs/architecture.md, read off the sources' #include lines.
struct LayeringRules {
  /// Modules from the bottom layer to the top one; a module includes its own headers and those of
  /// modules that stand before it.
  std::vector<std::string> layers;
  /// The oracle of what it judges: product code (all but *_test.cpp) of `judged` does not include
  /// it.
  std::string oracle;
  std::vector<std::string> judged;
};

/// Every include below `source_root` (the folder that holds the modules' folders) that breaks the
/// rules, as "<module>/<file>:<line>: <what is wrong>", sorted. Only includes of the form
/// "pencilscan/<module>/..." can; a folder that is no layer is reported too.
[[nodiscard]] std::vector<std::string> layering_violations(const std::filesystem::path& source_root,
                                                           const LayeringRules& rules);

/// Types that two headers below `source_root` define at the left margin, so in one namespace, as
/// "<type>: <file> and <file>", sorted. The linker would merge what templates make of both.
[[nodiscard]] std::vector<std::string> repeated_types(const std::filesystem::path& source_root);

}  // namespace pencilscan
