// Polynomials of one variable on [0, 1] in Bernstein form: a polynomial lies in the hull of its coefficients
// there, so what holds for all coefficients is proven for all parameters (Farouki & Rajan 1987).
#pragma once

#include <cstddef>
#include <utility>
#include <vector>

#include "nurbs/types.h"

namespace nurbs {

inline double binomial(int n, int k) {
  double b = 1;
  for (int i = 1; i <= k; ++i) b = b * (n - k + i) / i;
  return b;
}

// Coefficients of degree size() - 1; numbers or vectors.
template <class T>
using Bernstein = std::vector<T>;

// The product of two polynomials, coefficients multiplied by `times` (NURBS Book, section 6.3: C(p,i) C(q,k)
// / C(p+q,i+k)).
template <class A, class B, class Times>
auto multiply(const Bernstein<A>& a, const Bernstein<B>& b, const Times& times) {
  using T = decltype(times(a[0], b[0]));
  const int p = static_cast<int>(a.size()) - 1, q = static_cast<int>(b.size()) - 1;
  Bernstein<T> product(p + q + 1);
  std::vector<bool> set(p + q + 1, false);
  for (int i = 0; i <= p; ++i)
    for (int k = 0; k <= q; ++k) {
      const T term = binomial(p, i) * binomial(q, k) / binomial(p + q, i + k) * times(a[i], b[k]);
      product[i + k] = set[i + k] ? T(product[i + k] + term) : term;
      set[i + k] = true;
    }
  return product;
}

template <class T>
Bernstein<T> difference(const Bernstein<T>& a, const Bernstein<T>& b) {
  Bernstein<T> c(a);
  for (size_t i = 0; i < c.size(); ++i) c[i] -= b[i];
  return c;
}

template <class T>
Bernstein<T> derivative(const Bernstein<T>& a) {
  Bernstein<T> d;
  const double n = static_cast<double>(a.size()) - 1;
  for (size_t i = 0; i + 1 < a.size(); ++i) d.push_back(n * (a[i + 1] - a[i]));
  if (d.empty()) d.push_back(0 * a[0]);
  return d;
}

// The same polynomial, but for a positive factor, at s = ratio t / (1 + (ratio - 1) t).
template <class T>
void reparametrise(double ratio, Bernstein<T>* a) {
  double power = 1;
  for (T& c : *a) {
    c *= power;
    power *= ratio;
  }
}

// a / t of a polynomial whose first coefficient is zero.
template <class T>
Bernstein<T> without_root_at_0(const Bernstein<T>& a) {
  Bernstein<T> b;
  const double n = static_cast<double>(a.size()) - 1;
  for (size_t i = 1; i < a.size(); ++i) b.push_back((n / static_cast<double>(i)) * a[i]);
  return b;
}

// De Casteljau at 1/2 on degree + 1 coefficients `stride` apart: `a` keeps those of [0, 1/2], `b` gets those
// of [1/2, 1].
template <class T>
void halve_row(T* a, T* b, int degree, int stride) {
  for (int i = 0; i <= degree; ++i) {
    b[(degree - i) * stride] = a[degree * stride];
    for (int k = degree; k > i; --k) a[k * stride] = 0.5 * (a[k * stride] + a[(k - 1) * stride]);
  }
}

// The same along one parameter of a net of (degree_u + 1)(degree_v + 1) coefficients, v fastest.
template <class T>
void halve_net(T* a, T* b, int degree_u, int degree_v, bool in_u) {
  const int row = degree_v + 1;
  if (in_u)
    for (int j = 0; j < row; ++j) halve_row(a + j, b + j, degree_u, row);
  else
    for (int i = 0; i <= degree_u; ++i) halve_row(a + i * row, b + i * row, degree_v, 1);
}

// On [0, 1/2] and [1/2, 1].
template <class T>
std::pair<Bernstein<T>, Bernstein<T>> halve(Bernstein<T> a) {
  Bernstein<T> b(a);
  halve_row(a.data(), b.data(), static_cast<int>(a.size()) - 1, 1);
  return {std::move(a), std::move(b)};
}

}  // namespace nurbs
