#pragma once

#include <cstdint>
#include <filesystem>
#include <functional>
#include <nlohmann/json_fwd.hpp>
#include <ostream>
#include <string>

namespace pencilscan {

/// Whether bytes have to be on the disk before a call returns. Without, they outlive the end of the
/// program (kill -9) but not a power failure, and the disk is not waited for.
enum class Durability : std::uint8_t { kProcess, kDisk };

/// Writes a file whole or not at all: `write` fills a file without a name where the disk can do
/// that, which is flushed, checked and takes the place of `path`. Parent folders are made.
/// StageError (naming the file) when the disk is full or the folder cannot be written; nothing of
/// it stays then.
void write_atomically(const std::filesystem::path& path,
                      const std::function<void(std::ostream&)>& write,
                      Durability durability = Durability::kDisk);
/// The text as it is, as write_atomically() does.
void write_text(const std::filesystem::path& path, const std::string& text,
                Durability durability = Durability::kDisk);
/// What is not UTF-8 becomes U+FFFD.
void write_json(const std::filesystem::path& path, const nlohmann::ordered_json& value,
                Durability durability = Durability::kDisk);

/// The whole file as bytes; InputError when it is not there or not readable.
[[nodiscard]] std::string read_file(const std::filesystem::path& path);
/// The last line of a text that is not empty: how far a program is that writes it. Empty when there
/// is none, or no such file.
[[nodiscard]] std::string last_line(const std::filesystem::path& path);
/// Parsed JSON; InputError with line and column when it is not JSON (NaN and Infinity are not).
[[nodiscard]] nlohmann::json read_json(const std::filesystem::path& path);

}  // namespace pencilscan
