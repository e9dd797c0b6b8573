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

/// Writes a file whole or not at all: `write` fills a temporary neighbour, which is flushed,
/// checked and renamed over `path`. Parent folders are made. StageError (naming the file) when the
/// disk is full or the folder cannot be written; the temporary file is removed then.
void write_atomically(const std::filesystem::path& path,
                      const std::function<void(std::ostream&)>& write,
                      Durability durability = Durability::kDisk);
void write_text(const std::filesystem::path& path, const std::string& text,
                Durability durability = Durability::kDisk);
void write_json(const std::filesystem::path& path, const nlohmann::ordered_json& value,
                Durability durability = Durability::kDisk);

/// The whole file as bytes; InputError when it is not there or not readable.
[[nodiscard]] std::string read_file(const std::filesystem::path& path);
/// Parsed JSON; InputError with line and column when it is not JSON (NaN and Infinity are not).
[[nodiscard]] nlohmann::json read_json(const std::filesystem::path& path);

}  // namespace pencilscan
