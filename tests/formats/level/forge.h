// Levels taken apart and put together again, lump by lump.
#pragma once
#include "formats/level/kiln_level.h"
#include "formats/level/tables.h"
#include <array>
#include <cstring>
#include <gtest/gtest.h>
#include <string>
#include <vector>
#include <xxhash.h>
#include <zstd.h>

namespace kiln::level::test {

using Bytes = std::vector<std::uint8_t>;

// A file whose checksums are right, whatever was done to it: what someone with intent would send.
class Forge {
public:
    explicit Forge(const Bytes& good) {
        std::uint32_t count = 0;
        std::memcpy(&count, good.data() + 8, 4);
        for (std::uint32_t i = 0; i < count; ++i) {
            Lump l;
            std::memcpy(l.entry.data(), good.data() + kHeaderSize + i * kEntrySize, kEntrySize);
            std::uint64_t offset = 0, stored = 0, raw = 0;
            std::memcpy(&offset, l.entry.data() + 16, 8), std::memcpy(&stored, l.entry.data() + 24, 8), std::memcpy(&raw, l.entry.data() + 32, 8);
            std::uint16_t codec = 0;
            std::memcpy(&codec, l.entry.data() + 10, 2);
            const auto* from = good.data() + offset;
            if (codec == KILN_CODEC_ZSTD) {
                l.bytes.resize(raw);
                EXPECT_EQ(ZSTD_decompress(l.bytes.data(), raw, from, stored), raw);
            } else {
                l.bytes.assign(from, from + stored);
            }
            lumps.push_back(l);
        }
    }
    struct Lump {
        std::array<std::uint8_t, kEntrySize> entry{};
        Bytes bytes; // raw; written without compression
        std::string name() const { return std::string(reinterpret_cast<const char*>(entry.data()), 4); }
    };
    std::vector<Lump> lumps;
    Lump& operator[](const std::string& name) {
        for (Lump& l : lumps)
            if (l.name() == name) return l;
        throw std::out_of_range(name);
    }
    Bytes bytes() const {
        Bytes directory, body;
        std::uint64_t at = kHeaderSize + lumps.size() * kEntrySize;
        for (const Lump& l : lumps) {
            auto e = l.entry;
            const std::uint16_t none = 0;
            const std::uint64_t size = l.bytes.size(), hash = XXH3_64bits(l.bytes.data(), l.bytes.size());
            std::memcpy(e.data() + 10, &none, 2);
            std::memcpy(e.data() + 16, &at, 8), std::memcpy(e.data() + 24, &size, 8);
            std::memcpy(e.data() + 32, &size, 8), std::memcpy(e.data() + 40, &hash, 8);
            directory.insert(directory.end(), e.begin(), e.end());
            body.insert(body.end(), l.bytes.begin(), l.bytes.end());
            at += size;
        }
        Put header;
        header.value(kMagic), header.value(std::uint32_t{1}), header.value(static_cast<std::uint32_t>(lumps.size()));
        header.value(std::uint32_t{0}), header.value(at);
        Bytes hashed = header.bytes;
        hashed.insert(hashed.end(), directory.begin(), directory.end());
        header.value(std::uint64_t{XXH3_64bits(hashed.data(), hashed.size())});
        Bytes file = header.bytes;
        file.insert(file.end(), directory.begin(), directory.end());
        file.insert(file.end(), body.begin(), body.end());
        return file;
    }
};

} // namespace kiln::level::test
