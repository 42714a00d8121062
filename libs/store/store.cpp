#include "libs/store/store.h"
#include "libs/core/file.h"
#include <cstring>
#include <filesystem>
#include <memory>
#include <zstd.h>

namespace kiln {
namespace {

struct Header {
    char magic[8] = {'K', 'I', 'L', 'N', 'S', 'T', 'O', '1'};
    std::uint64_t size = 0; // uncompressed
    Hash key, content;      // content: of the uncompressed bytes
};
static_assert(sizeof(Header) == 48);
constexpr int kLevel = 1; // entries are read back soon: speed over size

} // namespace

std::string ContentStore::path(Hash key) const {
    const std::string hex = to_hex(key);
    return folder_ + "/" + hex.substr(0, 2) + "/" + hex;
}

std::optional<Bytes> ContentStore::load(Hash key, bool* damaged) const {
    if (!enabled()) return std::nullopt;
    const std::string file = path(key);
    std::error_code error;
    if (!std::filesystem::is_regular_file(file, error)) return std::nullopt;
    const auto bad = [&]() -> std::optional<Bytes> {
        if (damaged) *damaged = true;
        return std::nullopt;
    };
    const Result<Bytes> stored = read_file(file);
    if (!stored || stored->size() < sizeof(Header)) return bad();
    Header header, expected;
    std::memcpy(&header, stored->data(), sizeof header);
    if (std::memcmp(header.magic, expected.magic, sizeof header.magic) != 0 || header.key != key) return bad();
    const std::uint8_t* packed = stored->data() + sizeof header;
    const std::size_t packed_size = stored->size() - sizeof header;
    // The frame's own idea of its size is checked before anything is allocated by it.
    if (ZSTD_getFrameContentSize(packed, packed_size) != header.size) return bad();
    Bytes bytes(header.size);
    if (ZSTD_decompress(bytes.data(), bytes.size(), packed, packed_size) != header.size) return bad();
    if (hash_bytes(bytes) != header.content) return bad();
    return bytes;
}

bool ContentStore::save(Hash key, std::span<const std::uint8_t> bytes) const {
    if (!enabled()) return true;
    Header header;
    header.size = bytes.size();
    header.key = key;
    header.content = hash_bytes(bytes);
    const std::size_t room = ZSTD_compressBound(bytes.size());
    const auto out = std::make_unique_for_overwrite<std::uint8_t[]>(sizeof header + room); // clearing it would touch it all
    std::memcpy(out.get(), &header, sizeof header);
    const std::size_t packed = ZSTD_compress(out.get() + sizeof header, room, bytes.data(), bytes.size(), kLevel);
    if (ZSTD_isError(packed)) return false;
    std::error_code error;
    std::filesystem::create_directories(std::filesystem::path(path(key)).parent_path(), error);
    return static_cast<bool>(write_file(path(key), std::span(out.get(), sizeof header + packed)));
}

} // namespace kiln
