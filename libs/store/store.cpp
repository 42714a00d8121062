#include "libs/store/store.h"
#include <cstring>
#include <filesystem>
#include <utility>
#include <zstd.h>

namespace kiln {
namespace {

struct Header {
    char magic[8] = {'K', 'I', 'L', 'N', 'S', 'T', 'O', '2'};
    std::uint64_t size = 0; // uncompressed
    std::uint64_t compressed = 0; // 1: a zstd frame follows; 0: the bytes
    Hash key, content;      // content: of the uncompressed bytes
};
static_assert(sizeof(Header) == 56);
constexpr int kLevel = -5; // of zstd, below its usual ones: written and read back soon, twice as fast as 1 for half as many bytes more

} // namespace

std::string ContentStore::path(Hash key) const {
    const std::string hex = to_hex(key);
    return folder_ + "/" + hex.substr(0, 2) + "/" + hex;
}

std::optional<Buffer> ContentStore::load(Hash key, bool* damaged) const {
    if (!enabled()) return std::nullopt;
    const std::string file = path(key);
    std::error_code error;
    if (!std::filesystem::is_regular_file(file, error)) return std::nullopt;
    const auto bad = [&]() -> std::optional<Buffer> {
        if (damaged) *damaged = true;
        return std::nullopt;
    };
    Result<Buffer> stored = map_file(file);
    if (!stored || stored->bytes().size() < sizeof(Header)) return bad();
    Header header, expected;
    std::memcpy(&header, stored->bytes().data(), sizeof header);
    if (std::memcmp(header.magic, expected.magic, sizeof header.magic - 1) != 0) return bad();
    if (header.magic[7] != expected.magic[7]) return std::nullopt; // of another version of the store
    if (header.key != key || header.compressed > 1) return bad();
    const std::span<const std::uint8_t> packed = std::as_const(*stored).bytes().subspan(sizeof header);
    if (!header.compressed) {
        if (packed.size() != header.size || hash_bytes(packed) != header.content) return bad();
        stored->keep(sizeof header, header.size);
        return *std::move(stored);
    }
    // The frame's own idea of its size is checked before anything is allocated by it.
    const unsigned long long size = ZSTD_getFrameContentSize(packed.data(), packed.size());
    if (size == ZSTD_CONTENTSIZE_ERROR || size == ZSTD_CONTENTSIZE_UNKNOWN || size != header.size) return bad();
    Buffer bytes(header.size);
    if (ZSTD_decompress(bytes.fill().data(), header.size, packed.data(), packed.size()) != header.size) return bad();
    if (hash_bytes(bytes.bytes()) != header.content) return bad();
    return bytes;
}

bool ContentStore::save(Hash key, std::span<const std::uint8_t> bytes, bool compressed) const {
    if (!enabled()) return true;
    Header header;
    header.size = bytes.size();
    header.compressed = compressed;
    header.key = key;
    header.content = hash_bytes(bytes);
    Buffer packed;
    if (compressed) {
        packed = Buffer(ZSTD_compressBound(bytes.size()));
        const std::size_t size = ZSTD_compress(packed.fill().data(), packed.bytes().size(), bytes.data(), bytes.size(), kLevel);
        if (ZSTD_isError(size)) return false;
        packed.keep(0, size), bytes = packed.bytes();
    }
    std::error_code error;
    std::filesystem::create_directories(std::filesystem::path(path(key)).parent_path(), error);
    const std::span<const std::uint8_t> head(reinterpret_cast<const std::uint8_t*>(&header), sizeof header);
    return static_cast<bool>(write_file(path(key), {head, bytes}, false)); // torn by a power cut it is a miss, by its hash
}

} // namespace kiln
