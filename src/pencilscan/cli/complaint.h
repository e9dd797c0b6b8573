#pragma once

#include <CLI/CLI.hpp>
#include <optional>
#include <string>
#include <vector>

namespace pencilscan::cli {

/// Why the words of a command line could not be understood, in one line: the word at fault, what it
/// was probably meant to be, and the help of that very command.
[[nodiscard]] std::string complaint(const CLI::App& program, const CLI::ParseError& error);

/// The complaint of an option that another option follows in the place of its value, which the
/// library would take for the value; and of a word that is empty.
[[nodiscard]] std::optional<std::string> missing_value(const CLI::App& program,
                                                       const std::vector<std::string>& words);

}  // namespace pencilscan::cli
