#pragma once

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <nlohmann/json_fwd.hpp>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "pencilscan/io/file.h"

namespace pencilscan {

/// Element types, little endian in files: |u1, <u2, <i4, <i8, <f4.
enum class ZarrType : std::uint8_t { kUint8, kUint16, kInt32, kInt64, kFloat32 };

/// The ZarrType of a C++ type.
template <class T>
constexpr ZarrType zarr_type() {
  static_assert(std::is_same_v<T, std::uint8_t> || std::is_same_v<T, std::uint16_t> ||
                std::is_same_v<T, std::int32_t> || std::is_same_v<T, std::int64_t> ||
                std::is_same_v<T, float>);
  if constexpr (std::is_same_v<T, std::uint8_t>) return ZarrType::kUint8;
  if constexpr (std::is_same_v<T, std::uint16_t>) return ZarrType::kUint16;
  if constexpr (std::is_same_v<T, std::int32_t>) return ZarrType::kInt32;
  if constexpr (std::is_same_v<T, std::int64_t>) return ZarrType::kInt64;
  return ZarrType::kFloat32;
}

[[nodiscard]] std::size_t zarr_bytes(ZarrType type);

/// Blosc's compressor: none (as is), LZ4 (fast: while recording) or Zstandard (small: to keep).
enum class ZarrCompression : std::uint8_t { kNone, kLz4, kZstd };

/// One array of a Zarr version 2 directory store: a folder with `.zarray` and one file a chunk.
/// Chunks at the border are whole, too.
struct ZarrArray {
  std::vector<std::int64_t> shape;
  std::vector<std::int64_t> chunks;  ///< size of one chunk, >= 1, as many as `shape`
  ZarrType type = ZarrType::kUint8;
  ZarrCompression compression = ZarrCompression::kNone;  ///< of chunks that are written
  double fill_value = 0;                                 ///< of chunks that are not there
  char separator = '.';                                  ///< of the indices in a chunk's name

  [[nodiscard]] std::size_t chunk_elements() const;
  [[nodiscard]] std::size_t chunk_bytes() const { return chunk_elements() * zarr_bytes(type); }
  /// The file of a chunk below the array's folder, such as "12.0.0".
  [[nodiscard]] std::string chunk_name(std::span<const std::int64_t> index) const;
};

/// Reads `.zarray`. InputError for what this program cannot read: another version, filters, order
/// F, compressors other than Blosc.
[[nodiscard]] ZarrArray read_zarr_array(const std::filesystem::path& folder);
/// Makes the folder, too.
void write_zarr_array(const std::filesystem::path& folder, const ZarrArray& array,
                      Durability durability = Durability::kDisk);

/// The bytes of one chunk, chunk_bytes() of them; nothing where the chunk is not there. InputError
/// for a damaged one. Safe on several threads.
[[nodiscard]] std::optional<std::vector<std::uint8_t>> read_zarr_chunk(
    const std::filesystem::path& folder, const ZarrArray& array,
    std::span<const std::int64_t> index);
/// Writes a chunk whole or not at all; StageError when the disk is full. Several threads may write
/// different chunks.
void write_zarr_chunk(const std::filesystem::path& folder, const ZarrArray& array,
                      std::span<const std::int64_t> index, std::span<const std::uint8_t> bytes,
                      Durability durability = Durability::kDisk);

/// The bytes of a whole array in row order, chunks that are not there filled with fill_value.
[[nodiscard]] std::vector<std::uint8_t> read_zarr_bytes(const std::filesystem::path& folder,
                                                        const ZarrArray& array);
/// Writes an array of one chunk with its `.zarray`.
void write_zarr_bytes(const std::filesystem::path& folder, const ZarrArray& array,
                      std::span<const std::uint8_t> bytes,
                      Durability durability = Durability::kDisk);

/// `.zgroup` and, where there are any, `.zattrs`.
void write_zarr_group(const std::filesystem::path& folder,
                      const nlohmann::ordered_json& attributes);
/// The attributes of a group; InputError when `folder` is none of version 2.
[[nodiscard]] nlohmann::json read_zarr_group(const std::filesystem::path& folder);
/// True for a folder that says that it is a Zarr group.
[[nodiscard]] bool is_zarr_group(const std::filesystem::path& folder);

}  // namespace pencilscan
