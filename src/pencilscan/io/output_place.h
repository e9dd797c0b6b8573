#pragma once

#include <filesystem>
#include <string>

namespace pencilscan {

/// InputError where `out` is the folder that `option` names, or lies in it: what is read is not
/// written to, and a result among frame folders would be taken for a frame the next time. An empty
/// `input` is none.
void refuse_as_output(const std::string& option, const std::filesystem::path& input,
                      const std::filesystem::path& out);

}  // namespace pencilscan
