#include "pencilscan/io/zarr_array.h"

#include <blosc.h>

#include <algorithm>
#include <bit>
#include <cmath>
#include <cstring>
#include <limits>
#include <nlohmann/json.hpp>
#include <numeric>

#include "pencilscan/core/check.h"
#include "pencilscan/core/error.h"

namespace pencilscan {
namespace {

namespace fs = std::filesystem;
using nlohmann::json;
using nlohmann::ordered_json;

static_assert(std::endian::native == std::endian::little, "chunks are copied as they are");

constexpr const char* kArrayFile = ".zarray";
constexpr const char* kGroupFile = ".zgroup";
constexpr const char* kAttributesFile = ".zattrs";
/// Chunks of an array that is read whole: each is looked for.
constexpr std::int64_t kMaxChunks = 1'000'000;
/// The largest array or chunk that is read at once: beyond, a damaged shape is likelier than a
/// picture.
constexpr std::int64_t kMaxElements = std::int64_t{1} << 31;

struct NamedType {
  const char* name;
  ZarrType type;
};
constexpr NamedType kTypes[] = {{"|u1", ZarrType::kUint8},
                                {"<u2", ZarrType::kUint16},
                                {"<i4", ZarrType::kInt32},
                                {"<i8", ZarrType::kInt64},
                                {"<f4", ZarrType::kFloat32}};

const char* name_of(ZarrType type) {
  for (const NamedType& known : kTypes) {
    if (known.type == type) return known.name;
  }
  return "";
}

[[noreturn]] void fail(const fs::path& file, const std::string& field, const json& value,
                       const std::string& rule) {
  throw InputError(file.string(), field, value.is_null() ? "" : value.dump(), rule);
}

const json& field(const fs::path& file, const json& object, const char* key) {
  if (!object.contains(key)) fail(file, key, nullptr, "this key is missing");
  return object[key];
}

std::vector<std::int64_t> sizes(const fs::path& file, const json& object, const char* key,
                                std::int64_t least) {
  const json& list = field(file, object, key);
  std::vector<std::int64_t> result;
  const bool is_list = list.is_array() && !list.empty() && list.size() <= 8;
  for (const json& entry : is_list ? list : json::array()) {
    if (!entry.is_number_integer() || entry.get<std::int64_t>() < least) break;
    result.push_back(entry.get<std::int64_t>());
  }
  if (!is_list || result.size() != list.size())
    fail(file, key, list, "must be a list of whole numbers >= " + std::to_string(least));
  return result;
}

void check_elements(const fs::path& file, const char* key, const std::vector<std::int64_t>& box) {
  std::int64_t elements = 1;
  for (const std::int64_t size : box) {
    if (size > kMaxElements / elements) fail(file, key, box, "must have at most 2^31 elements");
    elements *= std::max<std::int64_t>(size, 1);
  }
}

/// "|b1" of NumPy's booleans reads as |u1.
ZarrType type_of(const fs::path& file, const json& object) {
  const json& value = field(file, object, "dtype");
  if (value == "|b1") return ZarrType::kUint8;
  for (const NamedType& known : kTypes) {
    if (value == known.name) return known.type;
  }
  fail(file, "dtype", value, "must be |u1, <u2, <i4, <i8 or <f4");
}

double fill_of(const json& value) {
  if (value.is_number()) return value.get<double>();
  if (value.is_boolean()) return value.get<bool>() ? 1 : 0;
  if (value == "NaN") return std::numeric_limits<double>::quiet_NaN();
  constexpr double kInfinity = std::numeric_limits<double>::infinity();
  return value == "Infinity" ? kInfinity : value == "-Infinity" ? -kInfinity : 0;
}

/// True for a number that becomes an element without leaving the type's range.
bool holds(ZarrType type, double value) {
  switch (type) {
    case ZarrType::kUint8:
      return value >= 0 && value <= 255;
    case ZarrType::kUint16:
      return value >= 0 && value <= 65535;
    case ZarrType::kInt32:
      return std::abs(value) <= 2147483647.0;
    case ZarrType::kInt64:
      return std::abs(value) <= 9e18;
    case ZarrType::kFloat32:
      return std::isinf(value) || !(std::abs(value) > std::numeric_limits<float>::max());
  }
  return false;
}

/// Whatever Blosc's header says is what a chunk is read with: the name decides only how new ones
/// are written.
ZarrCompression compression_of(const fs::path& file, const json& object) {
  const json& value = field(file, object, "compressor");
  if (value.is_null()) return ZarrCompression::kNone;
  if (!value.is_object() || value.value("id", json()) != "blosc")
    fail(file, "compressor", value, "must be null or Blosc");
  return value.value("cname", json()) == "lz4" ? ZarrCompression::kLz4 : ZarrCompression::kZstd;
}

/// Blosc's parameters: bit shuffle, because the high bits of neighbouring pixels agree.
ordered_json compressor_json(ZarrCompression compression) {
  if (compression == ZarrCompression::kNone) return nullptr;
  return {{"id", "blosc"},
          {"cname", compression == ZarrCompression::kLz4 ? "lz4" : "zstd"},
          {"clevel", 5},
          {"shuffle", BLOSC_BITSHUFFLE},
          {"blocksize", 0}};
}

std::vector<std::uint8_t> compress(const ZarrArray& array, std::span<const std::uint8_t> bytes) {
  constexpr int kLevel = 5;
  std::vector<std::uint8_t> packed(bytes.size() + BLOSC_MAX_OVERHEAD);
  const char* name = array.compression == ZarrCompression::kLz4 ? "lz4" : "zstd";
  const int size =
      blosc_compress_ctx(kLevel, BLOSC_BITSHUFFLE, zarr_bytes(array.type), bytes.size(),
                         bytes.data(), packed.data(), packed.size(), name, 0, 1);
  PENCILSCAN_CHECK(size > 0);
  packed.resize(static_cast<std::size_t>(size));
  return packed;
}

void write_bytes(const fs::path& path, std::span<const std::uint8_t> bytes, Durability durability) {
  write_atomically(
      path,
      [&](std::ostream& stream) {
        stream.write(reinterpret_cast<const char*>(bytes.data()),
                     static_cast<std::streamsize>(bytes.size()));
      },
      durability);
}

/// The element that stands for what is missing, as bytes.
std::vector<std::uint8_t> fill_bytes(const ZarrArray& array) {
  std::vector<std::uint8_t> bytes(zarr_bytes(array.type));
  const auto put = [&](auto value) { std::memcpy(bytes.data(), &value, sizeof value); };
  switch (array.type) {
    case ZarrType::kUint8:
      put(static_cast<std::uint8_t>(array.fill_value));
      break;
    case ZarrType::kUint16:
      put(static_cast<std::uint16_t>(array.fill_value));
      break;
    case ZarrType::kInt32:
      put(static_cast<std::int32_t>(array.fill_value));
      break;
    case ZarrType::kInt64:
      put(static_cast<std::int64_t>(array.fill_value));
      break;
    case ZarrType::kFloat32:
      put(static_cast<float>(array.fill_value));
      break;
  }
  return bytes;
}

/// Row-major steps of a box, in elements.
std::vector<std::int64_t> steps(const std::vector<std::int64_t>& box) {
  std::vector<std::int64_t> result(box.size(), 1);
  for (std::size_t k = box.size() - 1; k-- > 0;) result[k] = result[k + 1] * box[k + 1];
  return result;
}

/// The next index of a box in row order; false after the last one.
bool next_index(std::vector<std::int64_t>& index, const std::vector<std::int64_t>& box) {
  for (std::size_t k = box.size(); k-- > 0;) {
    if (++index[k] < box[k]) return true;
    index[k] = 0;
  }
  return false;
}

}  // namespace

std::size_t zarr_bytes(ZarrType type) {
  switch (type) {
    case ZarrType::kUint8:
      return 1;
    case ZarrType::kUint16:
      return 2;
    case ZarrType::kInt32:
    case ZarrType::kFloat32:
      return 4;
    case ZarrType::kInt64:
      return 8;
  }
  return 0;
}

std::size_t ZarrArray::chunk_elements() const {
  return static_cast<std::size_t>(
      std::accumulate(chunks.begin(), chunks.end(), std::int64_t{1}, std::multiplies<>()));
}

std::string ZarrArray::chunk_name(std::span<const std::int64_t> index) const {
  std::string name;
  for (const std::int64_t k : index)
    name += (name.empty() ? std::string() : std::string(1, separator)) + std::to_string(k);
  return name;
}

ZarrArray read_zarr_array(const fs::path& folder) {
  const fs::path file = folder / kArrayFile;
  const json object = read_json(file);
  if (!object.is_object() || object.value("zarr_format", json()) != 2)
    fail(file, "zarr_format", object.is_object() ? object.value("zarr_format", json()) : json(),
         "must be 2");
  ZarrArray array;
  array.shape = sizes(file, object, "shape", 0);
  array.chunks = sizes(file, object, "chunks", 1);
  if (array.shape.size() != array.chunks.size())
    fail(file, "chunks", object["chunks"], "must have as many numbers as shape");
  check_elements(file, "chunks", array.chunks);
  array.type = type_of(file, object);
  array.compression = compression_of(file, object);
  if (object.value("order", json("C")) != "C") fail(file, "order", object["order"], "must be C");
  if (!object.value("filters", json()).is_null())
    fail(file, "filters", object["filters"], "must be null");
  array.fill_value = fill_of(object.value("fill_value", json()));
  if (!holds(array.type, array.fill_value))
    fail(file, "fill_value", object["fill_value"], "must be a value of dtype");
  const json separator = object.value("dimension_separator", json("."));
  if (separator != "." && separator != "/")
    fail(file, "dimension_separator", separator, "must be . or /");
  array.separator = separator == "/" ? '/' : '.';
  return array;
}

void write_zarr_array(const fs::path& folder, const ZarrArray& array, Durability durability) {
  PENCILSCAN_CHECK(array.shape.size() == array.chunks.size());
  const bool is_float = array.type == ZarrType::kFloat32;
  ordered_json object;
  object["chunks"] = array.chunks;
  object["compressor"] = compressor_json(array.compression);
  object["dtype"] = name_of(array.type);
  if (is_float)
    object["fill_value"] = array.fill_value;
  else
    object["fill_value"] = static_cast<std::int64_t>(array.fill_value);
  object["filters"] = nullptr;
  object["order"] = "C";
  object["shape"] = array.shape;
  object["zarr_format"] = 2;
  if (array.separator != '.') object["dimension_separator"] = std::string(1, array.separator);
  write_json(folder / kArrayFile, object, durability);
}

std::optional<std::vector<std::uint8_t>> read_zarr_chunk(const fs::path& folder,
                                                         const ZarrArray& array,
                                                         std::span<const std::int64_t> index) {
  const fs::path file = folder / array.chunk_name(index);
  std::error_code ignored;
  if (!fs::exists(file, ignored)) return std::nullopt;
  const std::string stored = read_file(file);
  const std::size_t wanted = array.chunk_bytes();
  if (array.compression == ZarrCompression::kNone) {
    if (stored.size() != wanted) {
      throw InputError(
          file.string(), "bytes", std::to_string(stored.size()),
          "a chunk must have " + std::to_string(wanted) + ": it is damaged or of another size");
    }
    return std::vector<std::uint8_t>(stored.begin(), stored.end());
  }
  // No memory before the chunk itself says that it holds so much.
  std::size_t size = 0;
  std::vector<std::uint8_t> bytes;
  const bool is_whole =
      blosc_cbuffer_validate(stored.data(), stored.size(), &size) == 0 && size == wanted;
  if (is_whole) bytes.resize(wanted);
  if (!is_whole ||
      blosc_decompress_ctx(stored.data(), bytes.data(), wanted, 1) != static_cast<int>(wanted)) {
    throw InputError(file.string(), "", "",
                     "must be a whole Blosc chunk of " + std::to_string(wanted) +
                         " bytes: it is damaged or of another size");
  }
  return bytes;
}

void write_zarr_chunk(const fs::path& folder, const ZarrArray& array,
                      std::span<const std::int64_t> index, std::span<const std::uint8_t> bytes,
                      Durability durability) {
  PENCILSCAN_CHECK(bytes.size() == array.chunk_bytes());
  const fs::path file = folder / array.chunk_name(index);
  if (array.compression == ZarrCompression::kNone) return write_bytes(file, bytes, durability);
  write_bytes(file, compress(array, bytes), durability);
}

std::vector<std::uint8_t> read_zarr_bytes(const fs::path& folder, const ZarrArray& array) {
  check_elements(folder / kArrayFile, "shape", array.shape);
  const std::size_t rank = array.shape.size();
  const std::size_t size = zarr_bytes(array.type);
  const std::vector<std::int64_t> step = steps(array.shape);
  const std::vector<std::int64_t> chunk_step = steps(array.chunks);
  const std::int64_t elements = array.shape.front() * step.front();
  std::vector<std::int64_t> grid(rank);
  for (std::size_t k = 0; k < rank; ++k)
    grid[k] = (array.shape[k] + array.chunks[k] - 1) / array.chunks[k];
  if (steps(grid).front() * grid.front() > kMaxChunks)
    fail(folder / kArrayFile, "chunks", array.chunks, "must be at most 1,000,000 in all");
  std::vector<std::uint8_t> bytes;
  bytes.reserve(static_cast<std::size_t>(elements) * size);
  const std::vector<std::uint8_t> fill = fill_bytes(array);
  for (std::int64_t i = 0; i < elements; ++i) bytes.insert(bytes.end(), fill.begin(), fill.end());
  if (elements == 0) return bytes;

  std::vector<std::int64_t> at(rank, 0);
  do {
    const auto chunk = read_zarr_chunk(folder, array, at);
    if (!chunk) continue;
    std::vector<std::int64_t> within(rank, 0);
    do {
      std::int64_t from = 0;
      std::int64_t to = 0;
      bool inside = true;
      for (std::size_t k = 0; k < rank; ++k) {
        const std::int64_t x = at[k] * array.chunks[k] + within[k];
        inside = inside && x < array.shape[k];
        from += within[k] * chunk_step[k];
        to += x * step[k];
      }
      if (!inside) continue;
      std::memcpy(bytes.data() + static_cast<std::size_t>(to) * size,
                  chunk->data() + static_cast<std::size_t>(from) * size, size);
    } while (next_index(within, array.chunks));
  } while (next_index(at, grid));
  return bytes;
}

void write_zarr_bytes(const fs::path& folder, const ZarrArray& array,
                      std::span<const std::uint8_t> bytes, Durability durability) {
  ZarrArray whole = array;
  whole.chunks = array.shape;
  for (std::int64_t& size : whole.chunks) size = std::max<std::int64_t>(size, 1);
  write_zarr_array(folder, whole, durability);
  if (whole.chunks == whole.shape)
    write_zarr_chunk(folder, whole, std::vector<std::int64_t>(whole.shape.size(), 0), bytes,
                     durability);
}

void write_zarr_group(const fs::path& folder, const ordered_json& attributes) {
  if (!attributes.empty()) write_json(folder / kAttributesFile, attributes);
  write_json(folder / kGroupFile, {{"zarr_format", 2}});
}

nlohmann::json read_zarr_group(const fs::path& folder) {
  const fs::path file = folder / kGroupFile;
  const json group = read_json(file);
  if (!group.is_object() || group.value("zarr_format", json()) != 2)
    throw InputError(file.string(), "zarr_format", "", "must be 2");
  std::error_code ignored;
  if (!fs::exists(folder / kAttributesFile, ignored)) return json::object();
  const json attributes = read_json(folder / kAttributesFile);
  if (!attributes.is_object())
    throw InputError((folder / kAttributesFile).string(), "", "", "must be an object");
  return attributes;
}

bool is_zarr_group(const fs::path& folder) {
  std::error_code ignored;
  return fs::exists(folder / kGroupFile, ignored);
}

}  // namespace pencilscan
