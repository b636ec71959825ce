// As much of Metal's standard library as naga's shaders of draws use, for a C++ compiler: each thread is a call.
#include <cmath>
#include <cstdint>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <type_traits>
#include <vector>

typedef uint32_t uint;
#define kernel
#define constant const
#define device
#define thread

template <typename To, typename From> inline To as_type(From from) {
    static_assert(sizeof(To) == sizeof(From), "as_type keeps the bits");
    To to;
    std::memcpy(&to, &from, sizeof to);
    return to;
}

namespace metal {
using uint = ::uint;

template <typename T, int N> struct vec;
template <typename T> struct vec<T, 2> {
    T x, y;
    vec() = default;
    vec(T s) : x(s), y(s) {}
    vec(T a, T b) : x(a), y(b) {}
    T& operator[](uint i) { return (&x)[i]; }
    T operator[](uint i) const { return (&x)[i]; }
};
template <typename T> struct vec<T, 3> {
    T x, y, z;
    vec() = default;
    vec(T s) : x(s), y(s), z(s) {}
    vec(T a, T b, T c) : x(a), y(b), z(c) {}
    T& operator[](uint i) { return (&x)[i]; }
    T operator[](uint i) const { return (&x)[i]; }
};
template <typename T> struct vec<T, 4> {
    T x, y, z, w;
    vec() = default;
    vec(T s) : x(s), y(s), z(s), w(s) {}
    vec(T a, T b, T c, T d) : x(a), y(b), z(c), w(d) {}
    vec(vec<T, 2> a, T c, T d) : x(a.x), y(a.y), z(c), w(d) {}
    T& operator[](uint i) { return (&x)[i]; }
    T operator[](uint i) const { return (&x)[i]; }
};

#define OPERATOR(op) \
    template <typename T, int N> inline vec<T, N> operator op(vec<T, N> a, vec<T, N> b) { \
        for (int i = 0; i < N; i++) a[i] = a[i] op b[i]; \
        return a; \
    } \
    template <typename T, int N> inline vec<T, N> operator op(vec<T, N> a, std::common_type_t<T> b) { \
        for (int i = 0; i < N; i++) a[i] = a[i] op b; \
        return a; \
    } \
    template <typename T, int N> inline vec<T, N> operator op(std::common_type_t<T> a, vec<T, N> b) { \
        for (int i = 0; i < N; i++) b[i] = a op b[i]; \
        return b; \
    } \
    template <typename T, int N> inline vec<T, N>& operator op##=(vec<T, N>& a, vec<T, N> b) { return a = a op b; }
OPERATOR(+)
OPERATOR(-)
OPERATOR(*)
OPERATOR(^)
OPERATOR(&)
OPERATOR(|)

template <typename T, int N> inline vec<bool, N> operator==(vec<T, N> a, vec<T, N> b) {
    vec<bool, N> same;
    for (int i = 0; i < N; i++) same[i] = a[i] == b[i];
    return same;
}
template <int N> inline bool all(vec<bool, N> a) {
    for (int i = 0; i < N; i++) if (!a[i]) return false;
    return true;
}

using uint2 = vec<uint, 2>;
using uint3 = vec<uint, 3>;
using uint4 = vec<uint, 4>;
using int2 = vec<int, 2>;
using float2 = vec<float, 2>;
using float3 = vec<float, 3>;
using float4 = vec<float, 4>;

template <typename T> inline T max(T a, T b) { return a < b ? b : a; }
template <typename T> inline T min(T a, T b) { return b < a ? b : a; }
template <typename T> inline T clamp(T a, T low, T high) { return min(max(a, low), high); }
inline float abs(float a) { return std::fabs(a); }
inline float sqrt(float a) { return std::sqrt(a); }
template <typename T> inline T select(T no, T yes, bool condition) { return condition ? yes : no; }
} // namespace metal
using metal::uint2;

// The words of every buffer come in a file, in the order of their bindings, each after their number; and go out likewise.
static std::vector<std::vector<uint>> buffers;
inline void read_buffers(const char* path) {
    FILE* file = std::fopen(path, "rb");
    uint words;
    while (std::fread(&words, 4, 1, file) == 1) {
        buffers.emplace_back(words);
        if (std::fread(buffers.back().data(), 4, words, file) != words) std::abort();
    }
    std::fclose(file);
}
inline void write_buffers(const char* path) {
    FILE* file = std::fopen(path, "wb");
    for (auto& buffer : buffers) std::fwrite(buffer.data(), 4, buffer.size(), file);
    std::fclose(file);
}
