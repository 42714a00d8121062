// SPDX-License-Identifier: MIT
// Numbers to bytes and back. Tables are written column by column, each column split into byte planes (all first
// bytes, all second bytes, ...): what zstd likes, and no padding of a struct can reach the file.
// The reader checks every length against what is left before it allocates.
#pragma once
#include <array>
#include <bit>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <span>
#include <stdexcept>
#include <string>
#include <type_traits>
#include <vector>

namespace kiln::level {

static_assert(std::endian::native == std::endian::little, "the file is little-endian and read without swapping");

struct Damaged : std::runtime_error {
    using std::runtime_error::runtime_error;
};

using Blob = std::vector<std::uint8_t>;

// A row's member as a run of scalars: a scalar itself, or a C array of them.
template <class M> struct MemberTraits {
    using Scalar = std::remove_all_extents_t<M>;
    static constexpr std::size_t kCount = sizeof(M) / sizeof(Scalar);
};
template <class M> auto* scalars(M& member) {
    using S = std::remove_all_extents_t<std::remove_const_t<M>>;
    using P = std::conditional_t<std::is_const_v<std::remove_all_extents_t<M>>, const S*, S*>;
    return reinterpret_cast<P>(&member);
}

class Put {
public:
    Blob bytes;

    template <class T> void value(T v) {
        static_assert(std::is_arithmetic_v<T>);
        const std::size_t at = bytes.size();
        bytes.resize(at + sizeof v);
        std::memcpy(bytes.data() + at, &v, sizeof v);
    }
    void raw(std::span<const std::uint8_t> data) { bytes.insert(bytes.end(), data.begin(), data.end()); }
    // n scalars, get(i) each, as byte planes.
    template <class T, class Get> void planes(std::size_t n, const Get& get) {
        const std::size_t at = bytes.size();
        bytes.resize(at + n * sizeof(T));
        for (std::size_t i = 0; i < n; ++i) {
            const T v = get(i);
            std::uint8_t b[sizeof(T)];
            std::memcpy(b, &v, sizeof v);
            for (std::size_t k = 0; k < sizeof(T); ++k) bytes[at + k * n + i] = b[k];
        }
    }
    // The same calls as Get has, so that a table states its columns once (tables.h).
    template <class T> void scalar(const T& v) { value(v); }
    template <class T> void column(const std::vector<T>& values, std::size_t n) {
        if (values.size() != n) throw std::invalid_argument("a list has another length than its table says");
        planes<T>(n, [&](std::size_t i) { return values[i]; });
    }
    template <class Row, class... M> void rows(const std::vector<Row>& table, std::size_t n, M Row::*... members) {
        if (table.size() != n) throw std::invalid_argument("a table has another length than its head says");
        (member_column(table, members), ...);
    }
    void strings(const std::vector<std::string>& texts, std::size_t n) {
        if (texts.size() != n) throw std::invalid_argument("a list of texts has another length than its table says");
        planes<std::uint32_t>(n, [&](std::size_t i) { return static_cast<std::uint32_t>(texts[i].size()); });
        for (const std::string& s : texts) bytes.insert(bytes.end(), s.begin(), s.end());
    }

private:
    template <class Row, class M> void member_column(const std::vector<Row>& rows, M Row::*member) {
        using Scalar = typename MemberTraits<M>::Scalar;
        for (std::size_t k = 0; k < MemberTraits<M>::kCount; ++k)
            planes<Scalar>(rows.size(), [&](std::size_t i) { return scalars(rows[i].*member)[k]; });
    }
};

class Get {
public:
    explicit Get(std::span<const std::uint8_t> bytes) : left_(bytes) {}
    std::size_t left() const { return left_.size(); }
    void end() const {
        if (!left_.empty()) throw Damaged("a lump is longer than its content");
    }
    std::span<const std::uint8_t> raw(std::size_t size) {
        if (size > left_.size()) throw Damaged("a lump ends early");
        const auto part = left_.first(size);
        left_ = left_.subspan(size);
        return part;
    }
    template <class T> T value() {
        static_assert(std::is_arithmetic_v<T>);
        T v;
        std::memcpy(&v, raw(sizeof v).data(), sizeof v);
        return v;
    }
    template <class T, class Set> void planes(std::size_t n, const Set& set) {
        need(n, sizeof(T));
        const auto part = raw(n * sizeof(T));
        for (std::size_t i = 0; i < n; ++i) {
            std::uint8_t b[sizeof(T)];
            for (std::size_t k = 0; k < sizeof(T); ++k) b[k] = part[k * n + i];
            T v;
            std::memcpy(&v, b, sizeof v);
            set(i, v);
        }
    }
    template <class T> void column(std::vector<T>& values, std::size_t n) {
        need(n, sizeof(T));
        values.resize(n);
        planes<T>(n, [&](std::size_t i, T v) { values[i] = v; });
    }
    template <class T> void scalar(T& v) { v = value<T>(); }
    template <class Row, class... M> void rows(std::vector<Row>& table, std::size_t n, M Row::*... members) {
        need(n, (sizeof(M) + ...));
        table.resize(n);
        (member_column(table, members), ...);
    }
    void strings(std::vector<std::string>& texts, std::size_t n) {
        std::vector<std::uint32_t> sizes;
        column(sizes, n);
        texts.resize(n);
        for (std::size_t i = 0; i < n; ++i) {
            const auto part = raw(sizes[i]);
            texts[i].assign(part.begin(), part.end());
        }
    }

private:
    std::span<const std::uint8_t> left_;
    void need(std::size_t n, std::size_t each) const {
        if (n > left_.size() / each) throw Damaged("a lump ends early");
    }
    template <class Row, class M> void member_column(std::vector<Row>& rows, M Row::*member) {
        using Scalar = typename MemberTraits<M>::Scalar;
        for (std::size_t k = 0; k < MemberTraits<M>::kCount; ++k)
            planes<Scalar>(rows.size(), [&](std::size_t i, Scalar v) { scalars(rows[i].*member)[k] = v; });
    }
};

} // namespace kiln::level
