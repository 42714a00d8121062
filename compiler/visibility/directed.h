// Directed portals: each portal of the map once for each way through it, with the plane tests and the flood that
// bound what can be seen through it. Private to compiler/visibility.
#pragma once
#include "compiler/visibility/kernels.h"
#include "compiler/visibility/visibility.h"
#include <bit>
#include <cstdint>
#include <functional>
#include <memory>
#include <span>
#include <vector>

namespace kiln::vis {

// What the stage promises holds for lines of sight: those that pass each portal at least kInside within its edges and, from one
// portal to a later one, leave the planes of both by more than the noise. NOTES.md derives it.
constexpr double kInside = 1e-6; // map units
// Distances below this are rounding of the doubles the windings come in, not geometry.
constexpr double kNoise = 1e-7; // map units
// The error of dot(n, x) - d in doubles, n of length one and d such a dot, nowhere farther out than `reach` along an axis: four
// roundings of at most (sqrt 3 + sqrt 3) reach, and the normal's own length.
constexpr double evaluation_error(double reach) { return 16 * 0x1p-53 * reach; }
struct Rounding {
    double noise = kNoise; // larger only where coordinates are so large that doubles cannot tell it
    double error = 0;      // of evaluating a plane
};

struct Plane {
    Vec3 normal{};
    double distance = 0;
    double at(Vec3 p) const { return dot(normal, p) - distance; }
};

struct Directed {
    Vec3 center{};
    double radius = 0;
    std::span<const Vec3> points; // *winding
    Plane plane;           // normal along the way of travel
    bool has_plane = true; // false: the winding has no area; no plane test may reject it
    std::uint32_t from = 0, to = 0;
    const std::vector<Vec3>* winding = nullptr;
    PointsView shape; // the same points
    double sphere[4] = {}; // center and radius
};

// Portal i of the map is directed portals 2i (front to back) and 2i + 1 (back to front).
constexpr std::uint32_t reversed(std::uint32_t p) { return p ^ 1u; }
struct DirectedPortals {
    DirectedPortals() = default;
    DirectedPortals(const DirectedPortals&) = delete; // the shapes look into `coordinates`
    DirectedPortals(DirectedPortals&&) = default;
    std::vector<Directed> ways;
    std::vector<double> coordinates; // what `shape` looks at
    Rounding rounding;
    operator std::span<const Directed>() const { return ways; }
};
DirectedPortals directed_portals(std::span<const VisPortal> portals);

// Bit matrix with rows of whole words.
class BitRows {
public:
    BitRows() = default;
    BitRows(std::size_t rows, std::size_t bits) : words_((bits + 63) / 64), data_(rows * words_) {}
    std::size_t rows() const { return words_ ? data_.size() / words_ : 0; }
    std::size_t words() const { return words_; }
    std::vector<std::uint64_t>& data() { return data_; }
    std::uint64_t* row(std::size_t r) { return data_.data() + r * words_; }
    const std::uint64_t* row(std::size_t r) const { return data_.data() + r * words_; }

private:
    std::size_t words_ = 0;
    std::vector<std::uint64_t> data_;
};
inline bool get_bit(const std::uint64_t* row, std::size_t i) { return row[i / 64] >> (i % 64) & 1; }
inline void set_bit(std::uint64_t* row, std::size_t i) { row[i / 64] |= std::uint64_t{1} << (i % 64); }
inline void clear_bit(std::uint64_t* row, std::size_t i) { row[i / 64] &= ~(std::uint64_t{1} << (i % 64)); }
inline std::size_t count_bits(const std::uint64_t* row, std::size_t words) {
    std::size_t n = 0;
    for (std::size_t w = 0; w < words; ++w) n += static_cast<std::size_t>(std::popcount(row[w]));
    return n;
}

// Of a large map a way reaches a small part. Rows of ways, here and in what comes of them, hold only the blocks of eight words (the size of a
// cache line) in which the flood has anything; before them stands an empty one, which all that are missing are read from.
constexpr std::size_t kBlockWords = 8;
class RowLayout {
public:
    explicit RowLayout(const BitRows& of);
    // `there`: a bit for each block of each row, as `there()` says.
    RowLayout(std::size_t rows, std::size_t bits, std::span<const std::uint64_t> there);
    std::vector<std::uint64_t> there() const;
    std::size_t rows() const { return count_.size(); }
    std::size_t blocks() const { return blocks_; } // of a row that had them all
    const std::uint32_t* slots(std::size_t row) const { return slot_.data() + row * blocks_; } // per block its place in the row; 0: not there
    std::size_t words(std::size_t row) const { return (count_[row] + 1) * kBlockWords; }       // that are kept

private:
    std::size_t blocks_ = 0;
    std::vector<std::uint32_t> slot_, count_;
};
template <class Word> struct RowOf {
    const std::uint32_t* slot = nullptr;
    Word* data = nullptr; // null: no row
    std::uint64_t word(std::size_t w) const { return data[slot[w / kBlockWords] * kBlockWords + w % kBlockWords]; }
    bool has(std::size_t i) const { return word(i / 64) >> (i % 64) & 1; }
    void clear(std::size_t i) const { *place(i) &= ~(std::uint64_t{1} << (i % 64)); } // of a bit that is set
    operator RowOf<const Word>() const { return {slot, data}; }
    // The word that bit i is kept in; null: nowhere.
    Word* place(std::size_t i) const { return slot[i / 64 / kBlockWords] ? data + slot[i / 64 / kBlockWords] * kBlockWords + i / 64 % kBlockWords : nullptr; }
};
using Row = RowOf<const std::uint64_t>;
class SparseRows {
public:
    SparseRows() = default;
    // Row r as row `like(r)` of the layout, empty.
    template <class Like> SparseRows(std::shared_ptr<const RowLayout> layout, std::size_t rows, const Like& like) : layout_(std::move(layout)) {
        std::size_t size = 0;
        for (std::size_t r = 0; r < rows; ++r) like_.push_back(static_cast<std::uint32_t>(like(r))), first_.push_back(size), size += layout_->words(like_.back());
        first_.push_back(size);
        data_.resize(size);
    }
    explicit SparseRows(std::shared_ptr<const RowLayout> layout) : SparseRows(layout, layout->rows(), [](std::size_t r) { return r; }) {}
    explicit SparseRows(const BitRows& of);
    const std::shared_ptr<const RowLayout>& layout() const { return layout_; }
    std::size_t blocks() const { return layout_->blocks(); }
    std::size_t words() const { return blocks() * kBlockWords; } // of a row that had all
    std::vector<std::uint64_t>& data() { return data_; }
    Row row(std::size_t r) const { return {layout_->slots(like_[r]), data_.data() + first_[r]}; }
    RowOf<std::uint64_t> row(std::size_t r) { return {layout_->slots(like_[r]), data_.data() + first_[r]}; }
    std::span<const std::uint64_t> kept(std::size_t r) const { return {data_.data() + first_[r], data_.data() + first_[r + 1]}; }
    // f(number of the word, the word) of those that are kept, in order.
    template <class F> void each_word(std::size_t r, F&& f) const {
        const Row at = row(r);
        for (std::size_t b = 0; b < blocks(); ++b)
            for (std::size_t k = 0; at.slot[b] && k < kBlockWords; ++k) f(b * kBlockWords + k, at.data[at.slot[b] * kBlockWords + k]);
    }

private:
    std::shared_ptr<const RowLayout> layout_;
    std::vector<std::uint32_t> like_;
    std::vector<std::size_t> first_;
    std::vector<std::uint64_t> data_;
};
// f(i) of each bit.
template <class F> void each_bit(std::size_t word, std::uint64_t bits, F&& f) {
    for (; bits; bits &= bits - 1) f(static_cast<std::uint32_t>(word * 64 + static_cast<std::size_t>(std::countr_zero(bits))));
}

// The directed portals that leave each cluster, in order of their ids.
struct Exits {
    std::vector<std::uint32_t> first, portal; // cluster c: portal[first[c] .. first[c + 1])
    std::span<const std::uint32_t> of(std::uint32_t cluster) const {
        return {portal.data() + first[cluster], portal.data() + first[cluster + 1]};
    }
};
Exits exits_of(std::span<const Directed> portals, std::uint32_t cluster_count);

// Row p, bit q: a line can go forward through p and later forward through q, as far as the flood can tell: q is reached
// from p through portals each of which passes the plane tests against p and against the portal before it.
// `radius`: of sight, map units, 0: no limit. Once `stop` says so, ways that are left take what their plane tests alone say.
SparseRows flood(const DirectedPortals& portals, const Exits& exits, double radius, const std::function<bool()>& stop, Context& context);

} // namespace kiln::vis
