function [B, G] = magfem_field(model, points)
%MAGFEM_FIELD  Flux density of a magfem field model, and its gradient; for MATLAB and GNU Octave.
%
%   model = load('ring.mat');
%   [B, G] = magfem_field(model, [0 0 3e-3; 1e-3 0 4e-3])
%
%   points  n x 3, in m, in the model's frame
%   B       n x 3, in T, or in T/A where model.unit is 'T/A' (the field of 1 A)
%   G       n x 3 x 3, in T/m: G(k,i,j) is dB_i/dx_j at point k
%
%   Needs MATLAB R2016b or newer, or Octave, and no toolbox.
%
%   The model holds in its region only (model.region says which, model.about how well); elsewhere this evaluates it all
%   the same. On a wire, a rim or a centre of harmonics the field is infinite or NaN.
%
%   What the file holds, for n sources, c coefficients and v nodes:
%
%   kind                   n x 1 cell: 'loop', 'harmonics', 'interior', 'oblate', 'path', 'charge_disc'
%   centre                 n x 3, m
%   frame                  3 x 3 x n, columns are the source's own axes
%   radius                 n x 1, m: of a loop or disc; the reference radius of harmonics
%   first, last            n x 1: source k owns the coefficients first(k) to last(k)
%   coefficient            c x 1: A of a loop or path, T of a disc or of harmonics (Schmidt's semi-normalisation)
%   degree, order, sine    c x 1, of harmonics; sine is 1 for sin(m phi), and for imaginary parts of 'oblate'
%   first_node, last_node  n x 1: the nodes that source k owns
%   nodes                  v x 3, m: corners of closed paths, in their source's frame
%
%   name, unit, region, about   text

if nargin ~= 2 || size(points, 2) ~= 3 || ndims(points) ~= 2
    error('magfem:points', 'magfem_field(model, points) takes a loaded model and points of size n x 3, in m');
end
n = size(points, 1);
B = zeros(n, 3);
G = zeros(n, 9);
for first = 1:4096:n  % tables of harmonics are kept for so many points at a time
    some = first:min(first + 4095, n);
    [B(some, :), G(some, :)] = few_points(model, points(some, :));
end
G = reshape(G, n, 3, 3);  % column by column; the gradient is symmetric
end

function [B, G] = few_points(model, points)
B = zeros(size(points, 1), 3);
G = zeros(size(points, 1), 9);
for k = 1:numel(model.kind)
    R = model.frame(:, :, k);
    x = (points - model.centre(k, :)) * R;
    a = model.radius(k);
    own = model.first(k):model.last(k);
    value = model.coefficient(own);
    switch model.kind{k}
        case 'loop'
            jet = loop_jet(x, a, sum(value));
        case 'charge_disc'
            jet = disc_jet(x, a, sum(value));
        case 'path'
            jet = path_jet(x, model.nodes(model.first_node(k):model.last_node(k), :), sum(value));
        case 'oblate'
            C = scaled(value, model.degree(own), model.order(own), model.sine(own));
            jet = oblate_jet(x, a, model.degree(own), C);
        case 'harmonics'
            C = scaled(value, model.degree(own), model.order(own), model.sine(own));
            jet = harmonics_jet(x, a, model.degree(own), model.order(own), C, 1);
        case 'interior'
            l = model.degree(own);
            m = model.order(own);
            C = scaled(value, l, m, model.sine(own)) .* factorial(l - m) .* factorial(l + m);
            jet = harmonics_jet(x, a, l, m, C, -1);
        otherwise
            error('magfem:kind', 'this evaluator does not know sources of the kind %s', model.kind{k});
    end
    B = B + jet(:, 1:3) * R.';
    local = jet(:, [4 5 6 5 7 8 6 8 4]);
    local(:, 9) = -jet(:, 4) - jet(:, 7);
    G = G + local * kron(R, R).';
end
end

% The functions below give jets, n x 8, in the frame of one source: B_x, B_y, B_z and of the symmetric, trace-free
% gradient xx, xy, xz, yy, yz.

function jet = loop_jet(x, a, current)
% A circular loop about z (Simpson et al. 2001).
s = x(:, 1).^2 + x(:, 2).^2;
z = x(:, 3);
c = 1.25663706127e-6 / (4 * pi) * a^2 * current;
T = ring(x, a);
F = c * (0.5 * T(:, 1) + 1.5 * (a^2 + z.^2 - s) .* T(:, 2));
G = 3 * c * z .* T(:, 2);
F_s = 1.5 * c * (T(:, 2) - 5 * z.^2 .* T(:, 4));
G_s = 3 * c * z .* (35 / 6 * a^2 * T(:, 5) - 2.5 * T(:, 4));
jet = axisymmetric(x, F, G, F_s, G_s);
end

function jet = disc_jet(x, a, charge)
% A disc of magnetic charge about z (Derby and Olbert, Am. J. Phys. 78, 229 (2010)); on it, its upper side.
z = x(:, 3);
rho = hypot(x(:, 1), x(:, 2));
far = hypot(a + rho, z);
kc = hypot(a - rho, z) ./ far;
side = 1 - 2 * (z < 0);
gap = (a - rho) ./ (a + rho);
rim = abs(gap) < 1e-9;
gap(rim) = 1;
F = 0.5 * side .* (gap > 0) - a ./ (pi * (a + rho)) .* z ./ far .* cel(kc, gap.^2, 1, gap);
edge = 0.25 * side - z ./ (2 * pi * far) .* cel(kc, 1, 1, 1);
F(rim) = edge(rim);
c = charge / (4 * pi) * a^2;
T = ring(x, a);
jet = axisymmetric(x, charge * F, c * T(:, 1), -1.5 * c * z .* T(:, 2), c * (2.5 * a^2 * T(:, 3) - 1.5 * T(:, 2)));
end

function jet = axisymmetric(x, F, G, F_s, G_s)
% A field of revolution: B_z = F, B_rho/rho = G, and their derivatives by s = x^2 + y^2.
u = x(:, 1);
v = x(:, 2);
jet = [u .* G, v .* G, F, G + 2 * u.^2 .* G_s, 2 * u .* v .* G_s, 2 * u .* F_s, G + 2 * v.^2 .* G_s, 2 * v .* F_s];
end

function T = ring(x, a)
% Integrals over a period of sin(t)^2j (alpha - beta cos(t))^-p with alpha = a^2 + s + z^2, beta^2 = 4 a^2 s:
% columns T(1, 3/2), T(1, 5/2), T(2, 7/2), T(1, 7/2), T(2, 9/2).
s = x(:, 1).^2 + x(:, 2).^2;
rho = sqrt(s);
zz = x(:, 3).^2;
alpha = a^2 + s + zz;
beta2 = 4 * a^2 * s;
far = (a + rho).^2 + zz;
near = (a - rho).^2 + zz;
T = zeros(numel(s), 5);
K = cel(sqrt(near ./ far), 1, 1, 1);
E = cel(sqrt(near ./ far), 1, 1, near ./ far);
T(:, 1) = 8 ./ beta2 .* (alpha .* K ./ sqrt(far) - sqrt(far) .* E);
T(:, 2) = 8 ./ (3 * beta2 .* sqrt(far)) .* (alpha .* E ./ near - K);
T(:, 3) = 1.2 * (alpha .* T(:, 2) - T(:, 1)) ./ beta2;
ratio = beta2 ./ alpha.^2;
close_by = ratio < 0.04;  % where differences of K and E cancel
A = alpha(close_by);
T(close_by, 1) = pi * A.^-1.5 .* series(1, 1.5, ratio(close_by));
T(close_by, 2) = pi * A.^-2.5 .* series(1, 2.5, ratio(close_by));
T(close_by, 3) = 0.75 * pi * A.^-3.5 .* series(2, 3.5, ratio(close_by));
T(:, 4) = (0.8 * alpha .* T(:, 2) + 0.2 * T(:, 1)) ./ (far .* near);
T(:, 5) = 6 / 7 * (T(:, 2) - alpha .* T(:, 3) / 6) ./ (far .* near);
end

function total = series(j, p, ratio)
% 2F1(p/2, (p+1)/2; j+1; ratio) by its series; 14 terms reach rounding at 0.04.
total = ones(size(ratio));
term = total;
for n = 0:13
    term = term .* ratio * ((p / 2 + n) * ((p + 1) / 2 + n) / ((j + 1 + n) * (1 + n)));
    total = total + term;
end
end

function value = cel(kc, p, a, b)
% Bulirsch's complete elliptic integral of (a cos^2 + b sin^2) / ((cos^2 + p sin^2) sqrt(cos^2 + kc^2 sin^2)) over
% 0 to pi/2, p > 0 (Numer. Math. 13, 305 (1969)).
e = kc;
m = 1;
p = sqrt(p);
b = b ./ p;
f = a;
a = a + b ./ p;
g = e ./ p;
b = 2 * (b + f .* g);
p = p + g;
g = m;
m = m + kc;
for step = 1:20
    if all(abs(g - kc) <= 1e-9 * g | isnan(kc))
        break
    end
    kc = 2 * sqrt(e);
    e = kc .* m;
    f = a;
    a = a + b ./ p;
    g = e ./ p;
    b = 2 * (b + f .* g);
    p = p + g;
    g = m;
    m = m + kc;
end
value = pi / 2 * (a .* m + b) ./ (m .* (m + p));
end

function C = scaled(value, l, m, sine)
% C = N (g - i h): Schmidt's coefficients to those of J_l^m, below.
C = value .* sqrt((2 - (m == 0)) .* factorial(l - m) ./ factorial(l + m)) ./ factorial(l - m);
C(sine == 1) = -1i * C(sine == 1);
end

function jet = harmonics_jet(x, a, degree, order, C, d)
% V = a sum Re(C J_l^m), B = -grad V: exterior (d = 1) J = (l-m)! P_l^m(cos theta) e^(i m phi) / r^(l+1), interior
% (d = -1) J = r^l P_l^m(cos theta) e^(i m phi) / (l+m)!, at x/a. d/dz J_l^m = -d J_(l+d)^m, (d/dx + i d/dy) J_l^m =
% -J_(l+d)^(m+1), (d/dx - i d/dy) J_l^m = J_(l+d)^(m-1): letters z, p and q.
J = harmonics_table(x / a, max(degree) + 2, max(order) + 2, d);
[z, p, q, zz, zp, zq, pp, qq] = deal(zeros(size(x, 1), 1));
for k = 1:numel(degree)
    l = degree(k) + d;
    m = order(k);
    z = z - d * C(k) * entry(J, l, m);
    p = p - C(k) * entry(J, l, m + 1);
    q = q + C(k) * entry(J, l, m - 1);
    l = l + d;
    zz = zz + C(k) * entry(J, l, m);
    zp = zp + d * C(k) * entry(J, l, m + 1);
    zq = zq - d * C(k) * entry(J, l, m - 1);
    pp = pp + C(k) * entry(J, l, m + 2);
    qq = qq + C(k) * entry(J, l, m - 2);
end
B = -[real(p + q) / 2, imag(p - q) / 2, real(z)];
xx = real(pp - 2 * zz + qq) / 4;
yy = -real(pp + 2 * zz + qq) / 4;
jet = [B, -[xx, imag(pp - qq) / 4, real(zp + zq) / 2, yy, imag(zp - zq) / 2] / a];
end

function J = harmonics_table(x, top, widest, d)
% J_l^m at J(:, l + 1, m + 1), up to degree `top` and order `widest`.
r2 = sum(x.^2, 2);
widest = min(widest, top);
J = complex(zeros(size(x, 1), top + 1, widest + 1));
if d > 0
    diagonal = complex(1 ./ sqrt(r2));
else
    diagonal = complex(ones(size(r2)));
end
for m = 0:widest
    if m > 0 && d > 0
        diagonal = (2 * m - 1) * complex(x(:, 1), x(:, 2)) ./ r2 .* diagonal;
    elseif m > 0
        diagonal = complex(x(:, 1), x(:, 2)) / (2 * m) .* diagonal;
    end
    before = 0;
    here = diagonal;
    J(:, m + 1, m + 1) = here;
    for l = m:top - 1
        if d > 0
            after = ((2 * l + 1) * x(:, 3) .* here - (l^2 - m^2) * before) ./ r2;
        else
            after = ((2 * l + 1) * x(:, 3) .* here - r2 .* before) / ((l + 1)^2 - m^2);
        end
        before = here;
        here = after;
        J(:, l + 2, m + 1) = here;
    end
end
end

function value = entry(J, l, m)
% J_l^m for either sign of m; zero where there is none.
if l < abs(m)
    value = 0;
elseif m >= 0
    value = J(:, l + 1, m + 1);
else
    value = (-1)^m * conj(J(:, l + 1, 1 - m));
end
end

function jet = oblate_jet(x, a, degree, C)
% Axial harmonics about the complex centre i a on the axis: V = a sum Re(C_l Q_l^0) at the complex height z/a - i, with
% columns Q_l^m that climb by Q_(l+1)^m = [(2l+1) z Q_l^m - (l^2 - m^2) Q_(l-1)^m] / r^2.
x = x / a;
z = x(:, 3) - 1i;
r2 = complex(sum(x.^2, 2) - 1, -2 * x(:, 3));
root = sqrt(r2);
across = x(:, 3) == 0 & imag(root) > 0;  % the disc itself counts as its upper side
root(across) = -root(across);
here = [1 ./ root, zeros(numel(z), 2)];  % Q_0^0, and two columns that begin later
before = zeros(numel(z), 3);
[F, G, F_s, G_s] = deal(zeros(numel(z), 1));
start = [1, 1, 3];  % a column begins at (2m-1)!! / r^(2m+1)
for l = 1:max(degree) + 2
    next = zeros(numel(z), 3);
    for m = 0:2
        if l > m
            next(:, m + 1) = ((2 * l - 1) * z .* here(:, m + 1) - ((l - 1)^2 - m^2) * before(:, m + 1)) ./ r2;
        elseif l == m
            next(:, m + 1) = start(m + 1) ./ (root .* r2.^m);
        end
    end
    before = here;
    here = next;
    c = sum(C(degree == l - 1));
    F = F + c * here(:, 1);
    G = G + c * here(:, 2);
    c = sum(C(degree == l - 2));
    F_s = F_s - c * here(:, 2) / 2;
    G_s = G_s - c * here(:, 3) / 2;
end
jet = axisymmetric(x, real(F), real(G), real(F_s), real(G_s));
jet(:, 4:8) = jet(:, 4:8) / a;
end

function jet = path_jet(x, nodes, current)
% A closed chain of straight conductors (Hanson and Hirshman, Phys. Plasmas 9, 4410 (2002)).
jet = zeros(size(x, 1), 8);
for k = 1:size(nodes, 1)
    start = nodes(mod(k - 2, size(nodes, 1)) + 1, :);
    len = norm(nodes(k, :) - start);
    e = (nodes(k, :) - start) / len;
    ra = sqrt(sum((x - start).^2, 2));
    rb = sqrt(sum((x - nodes(k, :)).^2, 2));
    a = (x - start) ./ ra;
    b = (x - nodes(k, :)) ./ rb;
    w = a + b;
    inverse = 0.5 ./ (ra .* rb .* (1 + sum(a .* b, 2)));
    g1 = -2 * len * 1.25663706127e-6 / (4 * pi) * current * inverse;
    g2 = -2 * (ra + rb) .* inverse .* g1;
    bend = @(i, j) ((i == j) - a(:, i) .* a(:, j)) ./ ra + ((i == j) - b(:, i) .* b(:, j)) ./ rb;
    pair = @(i, j) g2 .* w(:, i) .* w(:, j) + g1 .* bend(i, j);
    xy = pair(1, 2);
    xz = pair(1, 3);
    yy = pair(2, 2);
    yz = pair(2, 3);
    zz = pair(3, 3);
    jet = jet + [g1 .* (w(:, 2) * e(3) - w(:, 3) * e(2)), ...
                 g1 .* (w(:, 3) * e(1) - w(:, 1) * e(3)), ...
                 g1 .* (w(:, 1) * e(2) - w(:, 2) * e(1)), ...
                 xy * e(3) - xz * e(2), yy * e(3) - yz * e(2), yz * e(3) - zz * e(2), ...
                 yz * e(1) - xy * e(3), zz * e(1) - xz * e(3)];
end
end
