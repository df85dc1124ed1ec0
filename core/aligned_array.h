// A fixed-size array aligned for vector loads, zero-initialised.
#pragma once

#include <algorithm>
#include <cstddef>
#include <memory>
#include <new>
#include <type_traits>

#include "core/simd.h"

namespace nephroid {

template <class T>
class AlignedArray {
    static_assert(std::is_trivially_copyable_v<T>);

  public:
    explicit AlignedArray(size_t size)
        : size_(size), data_(static_cast<T*>(::operator new (size * sizeof(T), std::align_val_t{simd_alignment}))) {
        std::fill_n(data_.get(), size, T());
    }

    size_t size() const { return size_; }
    T* data() { return data_.get(); }
    const T* data() const { return data_.get(); }
    T& operator[](size_t i) { return data_.get()[i]; }
    const T& operator[](size_t i) const { return data_.get()[i]; }

  private:
    struct Release {
        void operator()(T* pointer) const { ::operator delete (pointer, std::align_val_t{simd_alignment}); }
    };
    size_t size_;
    std::unique_ptr<T, Release> data_;
};

}  // namespace nephroid
