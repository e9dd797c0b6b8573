#pragma once

#include <CLI/CLI.hpp>
#include <string>

#include "pencilscan/page/page.h"

namespace pencilscan::cli {

/// What a page is of, of commands that make one: the folder, its title, and what lies elsewhere.
void add_page_arguments(CLI::App& command, std::string& folder, PageOptions& page);

}  // namespace pencilscan::cli
