#include "tests/two_reflections.h"

#include <cmath>
#include <random>

#include "core/rounding.h"
#include "core/warp.h"
#include "integrators/guided/lobe_weight.h"

namespace nephroid::testing {

namespace {

constexpr int second_directions = 8;
constexpr float largest_below_one = 0x1.fffffep-1F;

/// A guide asked for one vertex after the other.
class GuideAtVertex {
  public:
    explicit GuideAtVertex(const DirectionalGuide& guide)
        : worker_(guide.make_worker()), least_alpha_(guide.least_alpha()), batch_(1) {
        batch_.count = 1;
    }

    void look_at(const GuideVertex& vertex) {
        position_.set(0, vertex.position);
        geometric_normal_.set(0, vertex.geometric_normal);
        shading_normal_.set(0, vertex.shading_normal);
        wo_.set(0, vertex.wo);
        base_.set(0, to_vec3(vertex.bsdf.base));
        coat_f0_.set(0, to_vec3(vertex.bsdf.coat_f0));
        coat_f90_[0] = vertex.bsdf.coat_f90;
        metallic_[0] = vertex.bsdf.metallic;
        alpha_[0] = vertex.bsdf.alpha;
        is_left_alone_ = vertex.bsdf.metallic >= 1.0F && vertex.bsdf.alpha < least_alpha_;
        fraction_ = 0.0F;
        pdf(vertex.shading_normal);
        fraction_ = batch_.fraction[0];
    }
    /// Probability with which the guide is asked.
    float fraction() const { return fraction_; }
    float pdf(const Vec3& direction) {
        batch_.direction.set(0, direction);
        batch_.u_choice[0] = 1.0F;
        ask();
        return batch_.fraction[0] > 0.0F ? batch_.pdf[0] : 0.0F;
    }
    Vec3 sample(float u_lobe, float u, float v) {
        batch_.u_choice[0] = std::min(u_lobe * fraction_, fraction_ * largest_below_one);
        batch_.u[0] = u;
        batch_.v[0] = v;
        ask();
        return batch_.direction.get(0);
    }

  private:
    void ask() {
        batch_.fraction[0] = is_left_alone_ ? 0.0F : 1.0F;
        worker_->guide(
            {position_, geometric_normal_, wo_, wo_, shading_normal_, base_, coat_f0_, coat_f90_, metallic_, alpha_},
            batch_);
    }

    std::unique_ptr<GuideWorker> worker_;
    float least_alpha_;
    GuideBatch batch_;
    TripleArray position_{1}, geometric_normal_{1}, shading_normal_{1}, wo_{1}, base_{1}, coat_f0_{1};
    PathArray<float> coat_f90_{1}, metallic_{1}, alpha_{1};
    bool is_left_alone_ = false;
    float fraction_ = 0.0F;
};

/// Sums over second directions from one reflector point.
struct Second {
    double first_moment = 0.0;  ///< Mean of the radiance that arrives at the receiver.
    double squared_mean = 0.0;  ///< Of it, without bias.
    double guided = 0.0;        ///< Second moment of one guided sample.
    double path = 0.0;          ///< The same of one sample of the BSDF.
};

class Measurement {
  public:
    Measurement(const RenderContext& context, const DirectionalGuide& guide, const Receiver& receiver,
                const PathLight& light)
        : context_(context), receiver_(receiver), light_(light), at_point_(guide), at_reflector_(guide) {
        at_point_.look_at(diffuse_guide_vertex(receiver.position, receiver.geometric_normal));
    }

    TwoReflections run(uint32_t samples) {
        const Frame<float> frame = make_frame(to_triple(receiver_.geometric_normal));
        double mean = 0.0, guided = 0.0, at_point = 0.0, path = 0.0;
        const float fraction = at_point_.fraction();
        for (uint32_t i = 0; i < samples; ++i) {
            const bool by_guide = fraction > 0.0F && next() < 0.5F;
            const float u = next(), v = next();
            const Vec3 w =
                by_guide ? at_point_.sample(next(), u, v) : to_vec3(frame.to_world(square_to_cosine_hemisphere(u, v)));
            const double cosine = double{glm::dot(receiver_.geometric_normal, w)};
            if (!(cosine > 0.0)) continue;
            const double even = cosine * double{inv_pi}, lobes = fraction > 0.0F ? double{at_point_.pdf(w)} : 0.0;
            const double proposal = fraction > 0.0F ? 0.5 * (even + lobes) : even;
            const double density = double{fraction} * lobes + (1.0 - double{fraction}) * even;
            const Second second = second_from(w);
            mean += second.first_moment * cosine / proposal;
            guided += second.guided * cosine * cosine / (proposal * density);
            at_point += second.squared_mean * cosine * cosine / (proposal * density);
            path += second.path * cosine * cosine / (proposal * even);
        }
        const double n = samples;
        TwoReflections result;
        result.irradiance = mean / n;
        const auto deviation = [&](double moment) {
            return std::sqrt(std::max(moment / n / (result.irradiance * result.irradiance) - 1.0, 0.0));
        };
        result.guided = deviation(guided);
        result.guided_at_point = deviation(at_point);
        result.path = deviation(path);
        return result;
    }

  private:
    float next() { return std::min(uniform_(generator_), largest_below_one); }

    Second second_from(const Vec3& w) {
        const Vec3 origin = offset_ray_origin(receiver_.position, receiver_.error, receiver_.geometric_normal, w);
        const Hit hit = context_.accelerator.intersect({origin, w});
        if (hit.object >= context_.surfaces.object_count() || !context_.surfaces.is_caster(hit.object)) return {};
        const SurfaceInteraction s = context_.surfaces.interact(hit.object, hit.primitive, hit.u, hit.v, -w);
        at_reflector_.look_at({s.position, s.geometric_normal, s.shading_normal, -w, s.bsdf});
        const Receiver reflector{s.position,   s.error, s.geometric_normal, s.shading_normal,
                                 s.bsdf.alpha, 1.0F,    hit.object};
        const Frame<float> frame = make_frame(to_triple(s.shading_normal));
        const Triple<float> wo = frame.to_local(to_triple(-w));
        const float fraction = at_reflector_.fraction();
        double sum = 0.0, squares = 0.0;
        Second second;
        for (int k = 0; k < second_directions; ++k) {
            const float u_lobe = next(), u = next(), v = next();
            const Vec3 w2 = fraction > 0.0F && next() < 0.5F
                                ? at_reflector_.sample(u_lobe, u, v)
                                : to_vec3(frame.to_world(sample_bsdf(s.bsdf, wo, u_lobe, u, v).wi));
            const BsdfEvaluation<float> bsdf = evaluate_bsdf(s.bsdf, wo, frame.to_local(to_triple(w2)));
            const double lobes = fraction > 0.0F ? double{at_reflector_.pdf(w2)} : 0.0;
            const double by_bsdf = double{bsdf.pdf};
            const double proposal = fraction > 0.0F ? 0.5 * (by_bsdf + lobes) : by_bsdf;
            if (!(proposal > 0.0) || !(glm::dot(s.geometric_normal, w2) > 0.0F)) continue;
            const double radiance =
                double{reflected_radiance(context_, reflector, light_, w2)} * double{luminance(bsdf.value)};
            if (!(radiance > 0.0)) continue;
            const double density = double{fraction} * lobes + (1.0 - double{fraction}) * by_bsdf;
            sum += radiance / proposal;
            squares += radiance * radiance / (proposal * proposal);
            second.guided += radiance * radiance / (proposal * density) / second_directions;
            second.path += radiance * radiance / (proposal * std::max(by_bsdf, 1e-30)) / second_directions;
        }
        second.first_moment = sum / second_directions;
        second.squared_mean = (sum * sum - squares) / (second_directions * (second_directions - 1.0));
        return second;
    }

    const RenderContext& context_;
    const Receiver& receiver_;
    const PathLight& light_;
    GuideAtVertex at_point_, at_reflector_;
    std::mt19937 generator_{1};
    std::uniform_real_distribution<float> uniform_{0.0F, 1.0F};
};

}  // namespace

TwoReflections measure_two_reflections(const RenderContext& context, const DirectionalGuide& guide,
                                       const Receiver& receiver, const PathLight& light, uint32_t samples) {
    return Measurement(context, guide, receiver, light).run(samples);
}

}  // namespace nephroid::testing
