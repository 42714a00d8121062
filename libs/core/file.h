// Whole files in and out. Writing is all or nothing: a temporary name beside the target, synced, then renamed.
#pragma once
#include "libs/core/archive.h"
#include "libs/core/result.h"
#include <algorithm>
#include <initializer_list>
#include <memory>
#include <span>
#include <string>

namespace kiln {

// Bytes of a size known beforehand, not cleared first; or of a file where they lie.
class Buffer {
public:
    Buffer() = default;
    explicit Buffer(std::size_t size) : data_(new std::uint8_t[size]), size_(size) {}
    explicit Buffer(std::span<const std::uint8_t> copied) : Buffer(copied.size()) { std::ranges::copy(copied, data_.get()); }
    std::span<std::uint8_t> fill() { return {data_.get() + from_, size_}; } // not of a file's
    std::span<const std::uint8_t> bytes() const { return {data_.get() + from_, size_}; }
    void keep(std::size_t from, std::size_t size) { from_ += from, size_ = size; } // of the bytes these

private:
    friend Result<Buffer> map_file(const std::string& path);
    struct Release {
        std::size_t mapped; // 0: it is allocated
        Release() : mapped(0) {}
        explicit Release(std::size_t size) : mapped(size) {}
        void operator()(std::uint8_t* data) const;
    };
    std::unique_ptr<std::uint8_t[], Release> data_;
    std::size_t from_ = 0, size_ = 0;
};

// Without a copy: only of files that are never changed in place, as write_file replaces them. Exit::input where it cannot be read.
Result<Buffer> map_file(const std::string& path);
Result<Buffer> read_buffer(const std::string& path);            // Exit::input where it cannot be read
Result<Bytes> read_file(const std::string& path);               // likewise
Result<bool> write_file(const std::string& path, std::span<const std::uint8_t> bytes); // Exit::io
Result<bool> write_file(const std::string& path, const std::string& text);
// One after the other. `sync`: false where losing the file to a power cut does no harm.
Result<bool> write_file(const std::string& path, std::initializer_list<std::span<const std::uint8_t>> parts, bool sync = true);

} // namespace kiln
