#include "pencilscan/io/output_place.h"

#include <algorithm>
#include <system_error>

#include "pencilscan/core/error.h"
#include "pencilscan/io/partial_folder.h"

namespace pencilscan {

namespace fs = std::filesystem;

void refuse_as_output(const std::string& option, const fs::path& input, const fs::path& out) {
  if (input.empty()) return;
  std::error_code ignored;
  if (fs::equivalent(input, out, ignored))
    throw InputError("--out", "", out.string(), "must not be that of " + option);
  const auto whole = [&](const fs::path& path) {
    return fs::weakly_canonical(fs::absolute(bare_folder(path), ignored), ignored);
  };
  const fs::path read = whole(input), written = whole(out);
  const auto end = std::mismatch(read.begin(), read.end(), written.begin(), written.end());
  if (end.first == read.end())
    throw InputError("--out", "", out.string(), "must not lie in that of " + option);
}

}  // namespace pencilscan
