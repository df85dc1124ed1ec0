// The only place that knows which Embree this is: 3 (Debian 12, Ubuntu 22.04) or 4 (Debian 13, Ubuntu 24.04).
#pragma once

#if __has_include(<embree4/rtcore.h>)
#include <embree4/rtcore.h>
#include <embree4/rtcore_ray.h>
#else
#include <embree3/rtcore.h>
#include <embree3/rtcore_ray.h>
#endif

namespace nephroid::embree {

/// Rays that start together and go roughly the same way are traced as one packet; others share only their memory.
enum class Coherence { coherent, incoherent };

#if RTC_VERSION_MAJOR >= 4

struct Context {
    RTCRayQueryContext query;
    RTCIntersectArguments intersect;
    RTCOccludedArguments occluded;

    explicit Context(Coherence coherence) {
        const RTCRayQueryFlags flags =
            coherence == Coherence::coherent ? RTC_RAY_QUERY_FLAG_COHERENT : RTC_RAY_QUERY_FLAG_INCOHERENT;
        rtcInitRayQueryContext(&query);
        rtcInitIntersectArguments(&intersect);
        rtcInitOccludedArguments(&occluded);
        intersect.context = &query;
        occluded.context = &query;
        intersect.flags = flags;
        occluded.flags = flags;
    }
};

inline void intersect1(RTCScene scene, Context& context, RTCRayHit& ray) {
    rtcIntersect1(scene, &ray, &context.intersect);
}
inline void occluded1(RTCScene scene, Context& context, RTCRay& ray) {
    rtcOccluded1(scene, &ray, &context.occluded);
}
inline void intersect16(const int* valid, RTCScene scene, Context& context, RTCRayHit16& rays) {
    rtcIntersect16(valid, scene, &rays, &context.intersect);
}
inline void occluded16(const int* valid, RTCScene scene, Context& context, RTCRay16& rays) {
    rtcOccluded16(valid, scene, &rays, &context.occluded);
}

#else

struct Context {
    RTCIntersectContext query;

    explicit Context(Coherence coherence) {
        rtcInitIntersectContext(&query);
        query.flags = coherence == Coherence::coherent ? RTC_INTERSECT_CONTEXT_FLAG_COHERENT
                                                       : RTC_INTERSECT_CONTEXT_FLAG_INCOHERENT;
    }
};

inline void intersect1(RTCScene scene, Context& context, RTCRayHit& ray) {
    rtcIntersect1(scene, &context.query, &ray);
}
inline void occluded1(RTCScene scene, Context& context, RTCRay& ray) {
    rtcOccluded1(scene, &context.query, &ray);
}
inline void intersect16(const int* valid, RTCScene scene, Context& context, RTCRayHit16& rays) {
    rtcIntersect16(valid, scene, &context.query, &rays);
}
inline void occluded16(const int* valid, RTCScene scene, Context& context, RTCRay16& rays) {
    rtcOccluded16(valid, scene, &context.query, &rays);
}

#endif

}  // namespace nephroid::embree
