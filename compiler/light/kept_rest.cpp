#include "compiler/light/kept_rest.h"
#include "compiler/light/field_data.h"
#include <algorithm>
#include <bit>

namespace kiln {
namespace {

constexpr std::uint64_t kStates = 1, kSum = 2; // what a key is for, beside bundles
constexpr std::size_t kMostLights = 4096;      // then it begins anew

// What is kept of a bundle: what it met, and what emitters with rays of their own brought when its light was `seen`.
struct KeptBundle {
    std::uint64_t name = 0; // a hash of the rest
    FieldBundle bundle;
    std::uint64_t seen = 0;
    FieldEmitters emitters;
    template <class A> void fields(A& a) { a(name, bundle, seen, emitters); }
};
std::uint64_t name_of(std::span<const std::uint8_t> kept) {
    std::uint64_t name = 0;
    if (kept.size() < sizeof name) throw ArchiveError("archive ends early");
    std::memcpy(&name, kept.data(), sizeof name);
    return name;
}
struct KeptStates {
    std::vector<std::uint64_t> states, lights;
    std::vector<std::uint32_t> since;
    template <class A> void fields(A& a) { a(states, lights, since); }
};

// The next vector of an archive, as its bytes.
std::span<const std::uint8_t> vector_of(std::span<const std::uint8_t>& bytes, std::size_t each) {
    std::uint64_t count = 0;
    if (bytes.size() < sizeof count) throw ArchiveError("archive ends early");
    std::memcpy(&count, bytes.data(), sizeof count), bytes = bytes.subspan(sizeof count);
    if (count > bytes.size() / each) throw ArchiveError("archive ends early");
    const auto out = bytes.first(count * each);
    bytes = bytes.subspan(out.size());
    return out;
}
// Is it so for all places that rays and terms of a bundle name? Of the bundle as it is kept: most are asked for nothing else.
template <class Ok> bool each_place(std::span<const std::uint8_t> kept, const Ok& ok) {
    std::span<const std::uint8_t> bundle = kept.subspan(sizeof KeptBundle::name);
    const auto all = [&](std::span<const std::uint8_t> of, std::size_t step) { // each begins with its place
        for (std::size_t i = 0; i < of.size(); i += step) {
            std::uint32_t place = 0;
            std::memcpy(&place, &of[i], sizeof place);
            if (!ok(place)) return false;
        }
        return true;
    };
    static_assert(offsetof(FieldBundle::Term, place) == 0);
    if (!all(vector_of(bundle, sizeof(std::uint32_t)), sizeof(std::uint32_t))) return false;
    (void)vector_of(bundle, sizeof(FieldBundle::Several));
    return all(vector_of(bundle, sizeof(FieldBundle::Term)), sizeof(FieldBundle::Term));
}

} // namespace

KeptRest::KeptRest(const LightField& field, Memo* memo) : field_(field), memo_(memo) {
    if (!memo) return;
    for (const Vec3& p : field.data().surfaces.positions) bounds_.add(p);
    shining_ = field.shining_faces(), states_ = field.part_states(), emitters_ = states_[field.light_parts() - 1];
    note_changes();
}

void KeptRest::note_changes() {
    const std::vector<std::uint64_t> light(states_.begin(), states_.begin() + static_cast<std::ptrdiff_t>(field_.light_parts()));
    const std::uint64_t key = mix(kStates, shining_), now = hash_of(light).low;
    KeptStates before;
    if (const auto bytes = memo_->find(key, {})) before = from_bytes<KeptStates>(*bytes);
    if (before.states.size() != light.size() || before.since.size() != light.size() || before.lights.size() >= kMostLights) before = {light, {}, std::vector<std::uint32_t>(light.size())};
    lights_ = std::move(before.lights), since_ = std::move(before.since);
    if (!lights_.empty() && lights_.back() == now) return;
    const auto run = static_cast<std::uint32_t>(lights_.size());
    lights_.push_back(now);
    for (std::size_t i = 0; i < light.size(); ++i)
        if (light[i] != before.states[i]) since_[i] = run;
    memo_->keep(key, {}, {}, to_bytes(KeptStates{light, lights_, since_}));
}

bool KeptRest::unchanged(std::span<const std::uint8_t> bundle, std::uint64_t light) const {
    // The last run in that light: what was so before and after it counts as changed.
    const auto at = std::ranges::find(lights_.rbegin(), lights_.rend(), light);
    if (at == lights_.rend()) return false;
    const auto run = static_cast<std::uint32_t>(lights_.rend() - at - 1);
    if (since_.back() > run) return false; // the sky, and all that shines
    return each_place(bundle, [&](std::uint32_t place) { return place >= FieldBundle::kSeveral || since_[place] <= run; });
}

void KeptRest::sum(Vec3 point, Vec3 normal, std::uint32_t rays, std::uint64_t seed, std::uint64_t of, std::span<std::uint8_t> out, const std::function<void(const Arrivals&)>& add_up) const {
    std::uint64_t key = 0;
    if (memo_) {
        key = mix(shining_, seed, rays);
        for (const Vec3& v : {point, normal})
            for (std::size_t a = 0; a < 3; ++a) key = mix(key, std::bit_cast<std::uint64_t>(v[a]));
        key = key_in(bounds_, point, key);
    }
    const auto key_of_sum = [&](std::uint64_t name) { return key_in(bounds_, point, mix(key, kSum, of, name)); };
    thread_local Looked looked;
    const auto bytes = memo_ ? memo_->find(key, states_) : std::nullopt;
    if (bytes)
        if (const auto kept = memo_->find(key_of_sum(name_of(*bytes)), {}); kept && kept->size() == sizeof(std::uint64_t) + out.size()) {
            std::uint64_t light = 0;
            std::memcpy(&light, kept->data(), sizeof light);
            if (unchanged(*bytes, light)) {
                std::ranges::copy(kept->subspan(sizeof light), out.begin());
                return;
            }
        }
    KeptBundle kept;
    if (bytes) kept = from_bytes<KeptBundle>(*bytes);
    else kept.bundle = field_.bundle(point, normal, rays, seed, memo_ ? &looked : nullptr);
    const std::vector<Rgbd> reflected = field_.reflected(kept.bundle);
    const double level = field_.level(kept.bundle, reflected, normal, seed);
    const std::uint64_t seen = shining_ ? mix(emitters_, std::bit_cast<std::uint64_t>(level)) : 0; // all that what emitters bring is made from, but for the bundle
    std::uint64_t sum_key = memo_ && bytes ? key_of_sum(kept.name) : 0;
    if (!bytes || kept.seen != seen) {
        kept.emitters = field_.emitters(kept.bundle, level, point, normal, seed), kept.seen = seen;
        if (memo_) {
            kept.name = 0, kept.name = hash_of(kept).low;
            const Bytes now = to_bytes(kept);
            sum_key = key_of_sum(kept.name);
            if (bytes) memo_->renew(key, states_, now);
            else memo_->keep(key, states_, looked.parts(), now);
        }
    }
    add_up([&](const Arrival& of_emitters, const Arrival& of_rays) { field_.arriving(kept.bundle, reflected, kept.emitters, normal, seed, of_emitters, of_rays); });
    if (!memo_) return;
    ByteWriter w;
    w(lights_.back()), w.raw(out.data(), out.size());
    memo_->keep(sum_key, {}, {}, w.bytes);
}

} // namespace kiln
