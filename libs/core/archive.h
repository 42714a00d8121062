// Values to bytes and back, for the stage cache and for hashing. A type lists its fields once:
//     template <class A> void fields(A& a) { a(x, y, z); }
// or, when it is nothing but padding-free numbers, says `static constexpr bool kRawBytes = true`.
// Little-endian as on every machine we run on. A reader checks every length against what is left, so
// damaged bytes give an exception (ArchiveError), never an allocation of their choosing.
#pragma once
#include <array>
#include <bit>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <optional>
#include <span>
#include <stdexcept>
#include <string>
#include <type_traits>
#include <utility>
#include <vector>

namespace kiln {

static_assert(std::endian::native == std::endian::little);
using Bytes = std::vector<std::uint8_t>;

struct ArchiveError : std::runtime_error {
    using std::runtime_error::runtime_error;
};

namespace detail {
template <class T> concept MarkedRaw = requires { requires T::kRawBytes; };
template <class T> concept Raw =
    std::is_arithmetic_v<T> || std::is_enum_v<T> || (MarkedRaw<T> && std::is_trivially_copyable_v<T>) ||
    std::is_same_v<T, __int128>;
template <class T> struct is_vector : std::false_type {};
template <class T> struct is_vector<std::vector<T>> : std::true_type {};
template <class T> struct is_array : std::false_type {};
template <class T, std::size_t N> struct is_array<std::array<T, N>> : std::true_type {};
template <class T> struct is_optional : std::false_type {};
template <class T> struct is_optional<std::optional<T>> : std::true_type {};
template <class T> struct is_pair : std::false_type {};
template <class A, class B> struct is_pair<std::pair<A, B>> : std::true_type {};
} // namespace detail

class ByteWriter {
public:
    Bytes bytes;
    template <class... T> void operator()(const T&... values) { (put(values), ...); }
    // Not inlined: GCC 12 takes the growing vector for a fixed one and warns of an overflow that cannot be.
    [[gnu::noinline]] void raw(const void* data, std::size_t size) {
        if (count_only_) {
            count_ += size;
            return;
        }
        const auto* from = static_cast<const std::uint8_t*>(data);
        bytes.insert(bytes.end(), from, from + size);
    }
    // How many bytes the values take, which are not written.
    template <class... T> static std::size_t count(const T&... values) {
        ByteWriter w;
        w.count_only_ = true;
        w(values...);
        return w.count_;
    }

private:
    bool count_only_ = false;
    std::size_t count_ = 0;
    template <class T> void put(const T& v) {
        if constexpr (std::is_same_v<T, bool>) {
            const std::uint8_t b = v ? 1 : 0;
            raw(&b, 1);
        } else if constexpr (detail::Raw<T>) {
            raw(&v, sizeof v);
        } else if constexpr (std::is_same_v<T, std::string>) {
            put(static_cast<std::uint64_t>(v.size()));
            raw(v.data(), v.size());
        } else if constexpr (detail::is_vector<T>::value) {
            put(static_cast<std::uint64_t>(v.size()));
            if constexpr (detail::Raw<typename T::value_type> && !std::is_same_v<typename T::value_type, bool>)
                raw(v.data(), v.size() * sizeof(typename T::value_type));
            else
                for (const auto& e : v) put(e);
        } else if constexpr (detail::is_array<T>::value) {
            for (const auto& e : v) put(e);
        } else if constexpr (detail::is_optional<T>::value) {
            put(v.has_value());
            if (v) put(*v);
        } else if constexpr (detail::is_pair<T>::value) {
            put(v.first), put(v.second);
        } else {
            const_cast<T&>(v).fields(*this); // fields() only names members; a writer does not change them
        }
    }
};

class ByteReader {
public:
    explicit ByteReader(std::span<const std::uint8_t> bytes) : left_(bytes) {}
    template <class... T> void operator()(T&... values) { (get(values), ...); }
    std::size_t left() const { return left_.size(); }
    // A vector where it lies, as long as the bytes are there.
    template <class T> std::span<const T> view() {
        static_assert(detail::Raw<T>);
        const std::size_t n = length(sizeof(T));
        if (reinterpret_cast<std::uintptr_t>(left_.data()) % alignof(T) != 0) throw ArchiveError("archive is not aligned");
        const std::span<const T> out(reinterpret_cast<const T*>(left_.data()), n);
        left_ = left_.subspan(n * sizeof(T));
        return out;
    }

private:
    std::span<const std::uint8_t> left_;
    void raw(void* out, std::size_t size) {
        if (size > left_.size()) throw ArchiveError("archive ends early");
        if (size) std::memcpy(out, left_.data(), size);
        left_ = left_.subspan(size);
    }
    template <class T> void get(T& v) {
        if constexpr (std::is_same_v<T, bool>) {
            std::uint8_t b = 0;
            raw(&b, 1);
            v = b != 0;
        } else if constexpr (detail::Raw<T>) {
            raw(&v, sizeof v);
        } else if constexpr (std::is_same_v<T, std::string>) {
            v.resize(length(1));
            raw(v.data(), v.size());
        } else if constexpr (detail::is_vector<T>::value) {
            using E = typename T::value_type;
            if constexpr (detail::Raw<E> && !std::is_same_v<E, bool>) {
                const std::size_t n = length(sizeof(E));
                if constexpr (std::is_same_v<E, std::uint8_t>) { // not cleared first: there may be much of it
                    v.assign(left_.begin(), left_.begin() + static_cast<std::ptrdiff_t>(n));
                    left_ = left_.subspan(n);
                } else {
                    v.resize(n);
                    raw(v.data(), n * sizeof(E));
                }
            } else {
                v.clear();
                v.resize(length(1));
                for (std::size_t i = 0; i < v.size(); ++i) {
                    E e{};
                    get(e);
                    v[i] = std::move(e);
                }
            }
        } else if constexpr (detail::is_array<T>::value) {
            for (auto& e : v) get(e);
        } else if constexpr (detail::is_optional<T>::value) {
            bool has = false;
            get(has);
            v.reset();
            if (has) get(v.emplace());
        } else if constexpr (detail::is_pair<T>::value) {
            get(v.first), get(v.second);
        } else {
            v.fields(*this);
        }
    }
    std::size_t length(std::size_t element) {
        std::uint64_t n = 0;
        raw(&n, sizeof n);
        if (n > left_.size() / element) throw ArchiveError("archive length exceeds what is left");
        return static_cast<std::size_t>(n);
    }
};

template <class T> Bytes to_bytes(const T& value) {
    ByteWriter w;
    w.bytes.reserve(ByteWriter::count(value)); // copied once, however large
    w(value);
    return std::move(w.bytes);
}
template <class T> T from_bytes(std::span<const std::uint8_t> bytes) {
    ByteReader r(bytes);
    T value{};
    r(value);
    if (r.left()) throw ArchiveError("archive holds more than its value");
    return value;
}

} // namespace kiln
