#include "compiler/light/kept_rest.h"
#include <bit>

namespace kiln {
namespace {

// What is kept of a bundle: what it met, and what emitters with rays of their own brought when its light was `seen`.
struct KeptBundle {
    FieldBundle bundle;
    std::uint64_t seen = 0;
    FieldEmitters emitters;
    template <class A> void fields(A& a) { a(bundle, seen, emitters); }
};

} // namespace

KeptRest::KeptRest(const LightField& field, Memo* memo) : field_(field), memo_(memo) {
    if (memo) shining_ = field.shining_faces(), emitters_ = field.emitters_state(), states_ = field.part_states();
}

void KeptRest::arriving(Vec3 point, Vec3 normal, std::uint32_t rays, std::uint64_t seed, const Arrival& of_emitters, const Arrival& of_rays) const {
    std::uint64_t key = 0;
    if (memo_) {
        key = mix(shining_, seed, rays);
        for (const Vec3& v : {point, normal})
            for (std::size_t a = 0; a < 3; ++a) key = mix(key, std::bit_cast<std::uint64_t>(v[a]));
    }
    thread_local Looked looked;
    const auto bytes = memo_ ? memo_->find(key, states_) : std::nullopt;
    KeptBundle kept;
    if (bytes) kept = from_bytes<KeptBundle>(*bytes);
    else kept.bundle = field_.bundle(point, normal, rays, seed, memo_ ? &looked : nullptr);
    const std::vector<Rgbd> reflected = field_.reflected(kept.bundle);
    const std::uint64_t seen = memo_ ? seen_of(reflected) : 0;
    if (!bytes || kept.seen != seen) {
        kept.emitters = field_.emitters(kept.bundle, reflected, point, normal, seed), kept.seen = seen;
        if (bytes) memo_->renew(key, states_, to_bytes(kept));
        else if (memo_) memo_->keep(key, states_, looked.parts(), to_bytes(kept));
    }
    field_.arriving(kept.bundle, reflected, kept.emitters, normal, seed, of_emitters, of_rays);
}

} // namespace kiln
