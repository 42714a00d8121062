// The flow through one portal: what lines of sight that pass it can reach, chain of portals by chain of portals.
// Private to compiler/visibility.
#pragma once
#include "compiler/visibility/directed.h"
#include "compiler/visibility/proven.h"
#include <deque>
#include <functional>

namespace kiln::vis {

// A convex polygon, its points as arrays; keeps its memory.
class Polygon {
public:
    Polygon() = default;
    explicit Polygon(std::span<const Vec3> points);
    void assign(const PointsView& from);
    PointsView view() const { return {x(), x() + room_, x() + 2 * room_, n_}; }
    std::vector<Vec3> points() const;

    // What of `in` lies in front of the planes; `scratch` is used. False, and this undefined: nothing does.
    bool clip(const PointsView& in, const PlanesView& planes, const double* sphere, double open, double noise, Polygon& scratch);

private:
    std::vector<double> data_;
    std::uint32_t room_ = 0, n_ = 0;
    double* x() { return data_.data(); }
    const double* x() const { return data_.data(); }
    void grow(std::uint32_t room);
    PointsOut out() { return {x(), x() + room_, x() + 2 * room_, room_, n_}; }
};

class Planes {
public:
    PlanesView view() const { return {data_.data(), data_.data() + room_, data_.data() + 2 * room_, data_.data() + 3 * room_, n_}; }
    // Those with all of `source` behind and all of `pass` in front: who looks from source through pass sees only what lies in
    // front of each. The normals are those of the portals that the two are part of; null: it has none.
    void separate(const PointsView& source, const Directed& of_source, const PointsView& pass, const Directed& of_pass, const Rounding& rounding);

private:
    std::vector<double> data_;
    std::uint32_t room_ = 0, n_ = 0;
};

// A single plane in the shape of several.
struct OnePlane {
    double x[4], y[4], z[4], d[4];
    explicit OnePlane(const Plane& p, bool turned = false);
    PlanesView view() const { return {x, y, z, d, 1}; }
};

// What may be seen through two portals one after the other: of each way p and each way q out of the cluster it leads to, the
// portals not hidden by the planes that separate the two whole windings. Known beforehand, it costs a chain an `and`.
class Passages {
public:
    // `most`: bytes; ways into clusters with the most ways out go without. Once `stop` says so, the rest is left as it is.
    Passages(const DirectedPortals& portals, const Exits& exits, const SparseRows& reach, double epsilon, std::size_t most, const std::function<bool()>& stop, Context& context);
    // Of the k-th way out; without data: not known, anything.
    Row of(std::uint32_t p, std::size_t k) const { return first_[p] == kNone ? Row{} : rows_.row(first_[p] + k); }
    // Strikes from `reach` what is behind no passage, and what does not see back, until nothing changes or `stop` says so.
    void tighten(std::span<const Directed> portals, const Exits& exits, SparseRows& reach, const std::function<bool()>& stop, Context& context) const;

private:
    static constexpr std::size_t kNone = SIZE_MAX;
    std::vector<std::size_t> first_;
    SparseRows rows_;
};

struct FlowInput {
    const DirectedPortals* portals;
    const Exits* exits;
    const Windows* windows;
    const SparseRows* reach;            // per portal: an upper bound
    const Passages* passages;
    double epsilon;                     // map units every clip leaves standing behind its plane
    const std::function<bool()>* stop;  // asked now and then: true ends it
};

// Chains of portals, one after the other.
class Chains {
public:
    template <class Range> void add(const Range& chain) {
        for (const std::uint32_t p : chain) portals_.push_back(p);
        end_.push_back(static_cast<std::uint32_t>(portals_.size()));
    }
    std::size_t size() const { return end_.size(); }
    std::span<const std::uint32_t> operator[](std::size_t i) const {
        const std::size_t begin = i ? end_[i - 1] : 0;
        return {portals_.data() + begin, end_[i] - begin};
    }
    void clear() { portals_.clear(), end_.clear(); }
    template <class A> void fields(A& a) { a(portals_, end_); }

private:
    std::vector<std::uint32_t> portals_, end_;
};

enum class FlowEnd { done, over_budget, stopped };
struct FlowFound {
    std::uint64_t steps = 0;
    Chains witnesses; // of each portal that was added the chain that led to it: valid as long as along it each `reach` holds all later ones
    Chains lines;     // those among them that a line was found through
};
// Some bits of a row, those of no bit left out.
struct Bits {
    std::uint32_t word = 0;
    std::uint64_t bits = 0;
};
struct Frame {
    std::uint32_t portal = 0;             // the one entered last
    std::uint32_t next = 0, end = 0;      // which exits of its cluster come next
    Row reach, passage;                   // what may be seen behind it, as far as sets tell that are known beforehand
    Polygon source, pass;                 // the base portal's has no pass and no separators
    Planes separators;                    // of (source, pass)
    std::vector<Bits> wanted;             // what may be seen from here on, was not seen yet and lies behind no plane of the chain
};

// The flow through p. `seen` has as many words as whole rows of `reach`: portals seen through p are added. What is marked there beforehand
// need not be searched for; whether it is changes nothing of what is added. It can be put down after so many steps and taken up
// again, with a `seen` that has all that was in it then, and shared out.
class Flow {
public:
    Flow(const FlowInput& input, std::uint32_t p, const std::uint64_t* seen);
    // At most `steps` more (0: all). Not done: not all is in `seen`. `chain`: ends at the first that is added and says how it was reached.
    FlowEnd go(std::uint64_t steps, std::uint64_t* seen, FlowFound& found, SightChain* chain = nullptr);
    // An exit that it has not gone into yet, of the cluster that its chain has come to so many portals after p.
    struct Branch {
        std::uint32_t depth, exit;
    };
    std::vector<Branch> left() const; // the deepest first
    // The same from here on, but for no other branches than these, some that come one after the other.
    Flow part(std::span<const Branch> branches) const;

private:
    const FlowInput* in_ = nullptr;
    std::uint32_t base_ = 0;
    std::deque<Frame> frames_; // a deque: frames stay where they are while deeper ones come
    std::size_t depth_ = 0;
    std::vector<std::uint32_t> chain_;    // of portals, from p to the deepest frame's
    std::vector<std::uint64_t> on_chain_; // the same, by bits
    Flow() = default;
};

} // namespace kiln::vis
