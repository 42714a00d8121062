// Private to bsp: memory for many small arrays of one thread, given back in any order and used again. Threads have a pool
// each; what one has made, another may read and hold on to, but not give back.
#pragma once
#include <algorithm>
#include <array>
#include <bit>
#include <cstddef>
#include <memory>
#include <type_traits>
#include <utility>
#include <vector>

// What is given back, and what no one has taken yet, is not to be touched: AddressSanitizer is told.
#if defined(__SANITIZE_ADDRESS__)
#define KILN_POOL_ASAN 1
#elif defined(__has_feature)
#if __has_feature(address_sanitizer)
#define KILN_POOL_ASAN 1
#endif
#endif
#ifdef KILN_POOL_ASAN
#include <sanitizer/asan_interface.h>
#endif

namespace kiln::bsp {

class Pool {
public:
    // Not initialised. All goes with the pool.
    template <class T> T* take(std::size_t count) {
        static_assert(std::is_trivially_copyable_v<T> && alignof(T) <= alignof(std::max_align_t));
        return static_cast<T*>(take_bytes(count * sizeof(T)));
    }
    template <class T> void give(T* array, std::size_t count) { // `count`: that of take
        if (!array || count == 0) return;
        const std::size_t c = class_of(count * sizeof(T));
        allow(array, sizeof(void*)); // the array may be smaller than a pointer, its block is not
        *static_cast<void**>(static_cast<void*>(array)) = free_[c];
        free_[c] = array;
        forbid(array, size_of(c));
    }

    void clear() { // all that was taken is gone; the memory stays for what comes
        for (std::size_t i = 0; i < used_; ++i) forbid(chunks_[i].bytes.get(), chunks_[i].size);
        free_ = {};
        at_ = end_ = nullptr;
        used_ = 0;
    }
    Pool() = default;
    Pool(const Pool&) = delete; // nor moved: what was taken is known by its place
    Pool& operator=(const Pool&) = delete;
    ~Pool() { // to the heap as it came
        for (const Chunk& chunk : chunks_) allow(chunk.bytes.get(), chunk.size);
    }

private:
    struct Chunk {
        std::unique_ptr<std::byte[]> bytes;
        std::size_t size = 0;
    };
    // Multiples of 32 bytes up to 1024, then powers of two.
    static constexpr std::size_t kStep = 32, kFine = 32, kChunk = std::size_t{1} << 16, kLargestChunk = std::size_t{1} << 20;
    std::array<void*, kFine + 64> free_{};
    std::vector<Chunk> chunks_;
    std::size_t used_ = 0; // chunks; the last of them up to at_
    std::byte *at_ = nullptr, *end_ = nullptr;

    static void forbid([[maybe_unused]] void* at, [[maybe_unused]] std::size_t bytes) {
#ifdef KILN_POOL_ASAN
        ASAN_POISON_MEMORY_REGION(at, bytes);
#endif
    }
    static void allow([[maybe_unused]] void* at, [[maybe_unused]] std::size_t bytes) {
#ifdef KILN_POOL_ASAN
        ASAN_UNPOISON_MEMORY_REGION(at, bytes);
#endif
    }
    static std::size_t class_of(std::size_t bytes) {
        const std::size_t steps = (bytes + kStep - 1) / kStep;
        return steps <= kFine ? steps : kFine + static_cast<std::size_t>(std::bit_width(steps - 1)) - 5;
    }
    static std::size_t size_of(std::size_t of_class) {
        return of_class <= kFine ? of_class * kStep : kStep << (of_class - kFine + 5);
    }
    void* take_bytes(std::size_t bytes) {
        if (bytes == 0) return nullptr;
        const std::size_t c = class_of(bytes);
        if (void* const head = free_[c]) {
            allow(head, sizeof(void*));
            free_[c] = *static_cast<void**>(head);
            forbid(head, sizeof(void*)); // the block may be taken for less
            allow(head, bytes);
            return head;
        }
        const std::size_t size = size_of(c);
        if (static_cast<std::size_t>(end_ - at_) < size) next_chunk(size);
        void* const made = at_;
        at_ += size;
        allow(made, bytes);
        return made;
    }
    void next_chunk(std::size_t least) {
        while (used_ < chunks_.size() && chunks_[used_].size < least) ++used_;
        if (used_ == chunks_.size()) {
            const std::size_t size = std::max(least, std::min(kChunk << std::min(used_, std::size_t{4}), kLargestChunk));
            chunks_.push_back({std::make_unique_for_overwrite<std::byte[]>(size), size});
            forbid(chunks_.back().bytes.get(), size);
        }
        at_ = chunks_[used_].bytes.get(), end_ = at_ + chunks_[used_].size;
        ++used_;
    }
};

} // namespace kiln::bsp
