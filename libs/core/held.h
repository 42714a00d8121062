// An array that is not changed any more, and what keeps it: a vector, or the file in which it lies.
#pragma once
#include "libs/core/archive.h"
#include <memory>
#include <span>

namespace kiln {

template <class T> class Held {
public:
    Held() = default;
    Held(std::vector<T> own) : Held(std::make_shared<const std::vector<T>>(std::move(own))) {}
    Held(std::span<const T> of, std::shared_ptr<const void> keeper) : of_(of), keeper_(std::move(keeper)) {}
    const T& operator[](std::size_t i) const { return of_[i]; }
    std::size_t size() const { return of_.size(); }
    bool empty() const { return of_.empty(); }
    auto begin() const { return of_.begin(); }
    auto end() const { return of_.end(); }
    // As a vector is written. To read it where it lies: ByteReader::view.
    void fields(ByteWriter& w) { w(static_cast<std::uint64_t>(size())), w.raw(of_.data(), size() * sizeof(T)); }

private:
    explicit Held(std::shared_ptr<const std::vector<T>> own) : of_(*own), keeper_(std::move(own)) {}
    std::span<const T> of_;
    std::shared_ptr<const void> keeper_;
};

} // namespace kiln
