function [y, x] = @name@(u, x0)
%@NAME@  @title@
%
%   y = @name@(u) simulates the model for the input u, one value per sample,
%   from rest. y has one row per output and one column per sample.
%   [y, x] = @name@(u, x0) starts at the states x0 (SI) and gives the states too.
%
%   Sampling interval @dt@ s; between samples the input is @hold@.
%   Input: @input@.
%   Outputs: @outputs@.
%   States (SI): @states@.
%
%   The numbers are in @name@.mat beside this file:
%       x' = A x + B u + c + sum_k G(:,k) F_k(H(k,:) x + K(k) u),  y = C x + D u + ...
%   (SI; parameters and settings in the recording's units). Written by brightgrey @version@.
%
%   Exponential Radau IIA with two stages: the linear part and the input are
%   exact (tables E and T, matrix exponentials over a step and a third of it),
%   the forces F run linearly through both stages and are found by Newton's
%   method. A step is halved where its error estimate asks for it; limits are
%   located. So is the moment at which a mass with dry friction stops or breaks
%   away: it has v = 0 and as much friction as that takes meanwhile.
  m = load(fullfile(fileparts(mfilename('fullpath')), '@name@.mat'));
  u = m.input_factor * u(:)';
  if nargin < 2
    x0 = m.rest(:) * u(1);
  end
  s.x = x0(:);
  s.mode = zeros(1, m.limits);
  for b = 1:m.limits
    rate = m.rate(b, :) * s.x;
    state = s.x(m.limited(b));
    if m.high(b) <= m.low(b)
      s.mode(b) = 2;
    elseif state >= m.high(b) && rate >= 0
      s.mode(b) = 1;
    elseif state <= m.low(b) && rate <= 0
      s.mode(b) = -1;
    end
  end
  s.force = zeros(m.channels, 1);
  s.side = zeros(m.channels, 1);
  for k = find(m.stopped(:)')
    s.side(k) = sign(s.x(m.stopped(k)));
  end
  for k = sticking(m, s)
    s = settle(m, s, k, u(1));
  end
  s = set_force(m, s, u(1));
  x = zeros(m.n, numel(u));
  xdot = x;
  for k = 1:numel(u)
    if k > 1
      for base = 0:m.bases - 1
        s = base_step(m, s, u, k - 1, base);
      end
    end
    x(:, k) = s.x;
    xdot(:, k) = rates(m, s, delayed(m, u, k));
    for port = sticking(m, s) % the input may have jumped: friction at rest takes what it can
      i = m.stopped(port);
      needed = s.force(port) - xdot(i, k) / m.G(i, port);
      most = breakaway(m, port);
      xdot(i, k) = m.G(i, port) * (min(max(needed, -most), most) - needed);
    end
  end
  both = [x; xdot];
  y = both(m.row, :);
  for r = find(m.differenced(:)')
    before = y(r, 1) - m.dt * xdot(m.row(r), 1);
    y(r, :) = diff([before, y(r, :)]) / m.dt;
  end
  y = y .* m.output_factor(:);
end

function value = at(u, k)
% Input at sample k; the first and the last one go on.
  value = u(min(max(k, 1), numel(u)));
end

function value = delayed(m, u, k)
% Delayed input at sample k.
  value = at(u, k - m.whole);
  if m.shift > 0
    value = at(u, k - m.whole - 1);
    if m.linear
      value = value + (at(u, k - m.whole) - value) * (1 - m.shift);
    end
  end
end

function d = segment(m, u, k, start, count)
% Delayed input on the ticks [start, start + count) after sample k: value, slope,
% and jump and ramp (of value and slope) at a knot inside, `until` after the begin.
  per_sample = m.ticks * m.bases;
  part = start / per_sample - m.shift;
  i = k - m.whole;
  inside = false;
  if part < -1e-12
    part = part + 1;
    i = i - 1;
    inside = (start + count) / per_sample - m.shift > 1e-12;
  end
  part = max(part, 0);
  d = struct('value', at(u, i), 'slope', 0, 'jump', 0, 'ramp', 0, 'until', 0, 'inside', inside);
  if m.linear
    rise = at(u, i + 1) - at(u, i);
    d.value = d.value + rise * part;
    d.slope = rise / m.dt;
  end
  if inside
    d.until = (m.shift * per_sample - start) * (m.dt / per_sample);
    if m.linear
      d.ramp = (at(u, i + 2) - at(u, i + 1) - rise) / m.dt;
    else
      d.jump = at(u, i + 1) - at(u, i);
    end
  end
end

function value = seen(d, time)
% Input at a moment of the step.
  value = d.value + d.slope * time;
  if d.inside && time > d.until
    value = value + d.jump + d.ramp * (time - d.until);
  end
end

function A = matrix(m, s)
% System matrix: free limited states move with their rate.
  A = m.A;
  for b = find(s.mode == 0)
    A = A + m.column(:, b) * m.rate(b, :);
  end
end

function v = rates(m, s, u)
% x' with the forces as they are.
  v = matrix(m, s) * s.x + m.B * u + m.c;
  if m.channels > 0
    v = v + m.G * s.force;
  end
end

function s = set_force(m, s, u)
% Forces of the present state; their rate of change is not known and taken as zero.
  s.force = zeros(m.channels, 1);
  if m.channels > 0
    s.force = laws(s.side, m.H * s.x + m.K * u);
  end
  s.slope = zeros(m.channels, 1);
  s = hold_masses(m, s, u);
end

function k = sticking(m, s)
% Channels with dry friction whose mass sticks: side 1 or -1 means that it slides.
  k = find(m.stopped(:)' > 0 & s.side(:)' == 0);
end

function s = hold_masses(m, s, u)
% Friction of the masses that stick, as it has to be: it follows the input at once.
  stuck = sticking(m, s);
  if ~isempty(stuck)
    v = rates(m, s, u);
    for k = stuck
      s.force(k) = s.force(k) - v(m.stopped(k)) / m.G(m.stopped(k), k);
    end
  end
end

function most = breakaway(m, k)
% Largest friction at rest.
  force = laws(ones(m.channels, 1), zeros(m.channels, 1));
  most = -force(k);
end

function s = settle(m, s, k, u)
% A mass that has stopped sticks if friction can hold it, else it follows what drives it.
  s.side(k) = 0;
  s = set_force(m, s, u);
  if abs(s.force(k)) > breakaway(m, k)
    s.side(k) = -sign(s.force(k));
  end
end

function w = watch(m, s, b, x)
% Limited state b if it is free, else its rate.
  if s.mode(b) == 0
    w = x(m.limited(b), :);
  else
    w = m.rate(b, :) * x;
  end
end

function [low, high] = interval(m, s, b)
% Where the watched quantity has to stay. Behind the limited states come the channels of
% dry friction: side times speed of a mass that slides, friction of one that sticks.
  low = -Inf;
  high = Inf;
  if b > m.limits
    low = 0;
    if s.side(b - m.limits) == 0
      high = breakaway(m, b - m.limits);
      low = -high;
    end
    return
  end
  % Where a drive rests at the end of its gap, rounding must not open the contact.
  rounding = 1e-13 * abs(m.rate(b, :)) * abs(s.x);
  switch s.mode(b)
    case 0
      low = m.low(b);
      high = m.high(b);
    case 1
      low = -rounding;
    case -1
      high = rounding;
  end
end

function out = leaves(m, s, middle, final, z, F)
% Whether a watched quantity leaves its interval; a parabola stands for its course.
  out = false;
  for b = [1:m.limits, m.limits + find(m.stopped(:)')]
    k = b - m.limits;
    if k <= 0
      s0 = watch(m, s, b, s.x);
      s1 = watch(m, s, b, middle);
      s2 = watch(m, s, b, final);
    elseif s.side(k) == 0
      s0 = s.force(k);
      s1 = F(k);
      s2 = F(m.channels + k);
    else
      s0 = s.side(k) * s.x(m.stopped(k));
      s1 = s.side(k) * z(k);
      s2 = s.side(k) * z(m.channels + k);
      if s0 == 0 % it breaks away, and bends more than a parabola
        s1 = min(s1, s2);
        s2 = s1;
      end
    end
    slope = (s1 - s0) * 4.5 - (s2 - s0) * 0.5;
    bend = (s2 - s0) - slope;
    peak = slope * -0.5 / bend;
    extreme = s2;
    if 0 < peak && peak < 1
      extreme = s0 + peak * (slope + peak * bend);
    end
    slack = (abs(s0) + abs(s2)) * 1e-12 + 1e-300;
    [low, high] = interval(m, s, b);
    out = out || ~(low - slack < min(s2, extreme) && max(s2, extreme) < high + slack);
  end
end

function [failed, middle, final, z, F, err] = attempt(m, s, level, d)
% Two-stage step: states at a third and at the end, ports and forces at both.
  bits = 1 + sum(2 .^ (find(s.mode == 0) - 1));
  h = m.dt / (m.ticks * m.bases) * 2 ^ level;
  E = m.E{bits, level + 1};
  T = m.T{bits, level + 1};
  S = m.S{bits, level + 1};
  c = m.channels;
  known = [s.x; d.value; d.slope; 1];
  n = numel(known);
  middle = T(:, 1:n) * known + T(:, end - 1:end) * [d.jump; d.ramp];
  final = E(:, 1:n) * known + E(:, end - 1:end) * [d.jump; d.ramp];
  F = zeros(0, 1);
  z = F;
  err = 0;
  failed = false;
  if c == 0
    return
  end
  a = [m.H * middle + m.K * seen(d, h / 3); m.H * final + m.K * seen(d, h)];
  F = [s.force + s.slope * h / 3; s.force + s.slope * h];
  z = a + S * F;
  stuck = [sticking(m, s), c + sticking(m, s)]; % their rows are z = 0
  z(stuck) = 0;
  unit = ones(2 * c, 1);
  unit(stuck) = 0;
  for i = 1:m.newton
    [f1, d1] = laws(s.side, z(1:c));
    [f2, d2] = laws(s.side, z(c + 1:end));
    force = [f1; f2];
    by_port = [d1; d2];
    force(stuck) = -z(stuck);
    by_port(stuck) = -1;
    F = (diag(unit) - diag(by_port) * S) \ (force + by_port .* (a - z));
    next = a + S * F;
    change = max(abs(next - z));
    z = next;
  end
  failed = ~(change < m.change) || any(isnan(z));
  err = h * max(abs(s.force - (F(1:c) * 1.5 - F(c + 1:end) * 0.5)) .* m.gain(:));
  middle = middle + T(:, n + 1:end - 2) * F;
  final = final + E(:, n + 1:end - 2) * F;
end

function s = base_step(m, s, u, k, base)
% One base step, halved where it has to be.
  tick = m.dt / (m.ticks * m.bases);
  position = 0;
  level = m.levels;
  while position < m.ticks
    count = 2 ^ level;
    h = count * tick;
    d = segment(m, u, k, base * m.ticks + position, count);
    s = hold_masses(m, s, d.value);
    [failed, middle, final, z, F, err] = attempt(m, s, level, d);
    out = leaves(m, s, middle, final, z, F);
    if level > 0 && (failed || out || ~(err < m.error))
      level = level - 1;
      continue
    end
    if failed || out
      span = h;
      if d.inside
        span = d.until;
      end
      value = d.value + d.slope * span;
      s = creep(m, s, span, d.value, d.slope);
      if d.inside
        slope = d.slope + d.ramp;
        value = value + d.jump;
        s = creep(m, s, h - span, value, slope);
        value = value + slope * (h - span);
      end
      s = set_force(m, s, value);
    else
      for port = sticking(m, s)
        final(m.stopped(port)) = 0;
        if m.held(port) > 0
          final(m.held(port)) = s.x(m.held(port));
        end
      end
      s.x = final;
      c = m.channels;
      if c > 0
        s.force = F(c + 1:end);
        s.slope = (F(c + 1:end) - F(1:c)) * (1.5 / h);
      end
    end
    position = position + count;
    if level < m.levels && mod(position, 2 * count) == 0 && 8 * err < m.error
      level = level + 1;
    end
  end
end

function [terms, off, rate, span, needed] = series_at(m, s, value, slope, span)
% Taylor series of the motion from the present state, the laws replaced by their tangents, and the time it reaches.
% As long as a gap is open its damper may relax in nanoseconds (d/c); the other
% states do not feel it, and its position follows them; what it is off that at first fades with exp(-rate t).
% Masses that stick need the friction `needed`, by the states, 1 and t.
  A = matrix(m, s);
  b0 = m.B * value + m.c;
  b1 = m.B * slope;
  if m.channels > 0
    z = m.H * s.x + m.K * value;
    [force, by_port] = laws(s.side, z);
    A = A + m.G * diag(by_port) * m.H;
    b0 = b0 + m.G * (force + by_port .* (m.K * value - z));
    b1 = b1 + m.G * (by_port .* m.K) * slope;
  end
  needed = zeros(m.channels, m.n + 2);
  for k = sticking(m, s)
    i = m.stopped(k);
    needed(k, :) = -[A(i, :), b0(i), b1(i)] / m.G(i, k);
    A(i, :) = 0;
    b0(i) = 0;
    b1(i) = 0;
  end
  fast = [];
  for b = find(s.mode == 0)
    i = m.limited(b);
    others = [1:i - 1, i + 1:m.n];
    own = m.rate(b, i);
    if -own * span >= 8 && all(abs(A(others, i)) <= 1e-9 * abs(m.column(others, b) * own))
      fast(end + 1) = b;
    end
  end
  slow = A;
  slow(:, m.limited(fast)) = 0;
  terms = expand(m, s, slow, b0, b1);
  piece = reach(terms, span);
  off = zeros(1, m.limits);
  rate = zeros(1, m.limits);
  for b = fast
    [terms, off(b), rate(b)] = follow(m, b, terms);
  end
  if any(rate(fast) * piece < 8)
    off(:) = 0;
    terms = expand(m, s, A, b0, b1);
    piece = reach(terms, span);
  end
  span = piece;
end

function [terms, off, a] = follow(m, b, terms)
% The series of a fast state replaced by what it follows, and what it is off that at first, which fades with exp(-a t).
% The series holds the integral of what pulls it, p: x' = p - a x. It follows p/a - p'/a^2 + p''/a^3 - ...
  i = m.limited(b);
  a = -m.rate(b, i);
  before = terms(i, 1);
  follows = 0;
  for k = 15:-1:1
    pull = k * terms(i, k + 1);
    terms(i, k + 1) = follows;
    follows = (pull - k * follows) / a;
  end
  terms(i, 1) = follows;
  off = before - follows;
end

function terms = expand(m, s, A, b0, b1)
% Coefficients of the series of x' = A x + b0 + b1 t.
  terms = zeros(m.n, 16);
  terms(:, 1) = s.x;
  for i = 1:15
    terms(:, i + 1) = A * terms(:, i) / i;
    if i == 1
      terms(:, 2) = terms(:, 2) + b0;
    elseif i == 2
      terms(:, 3) = terms(:, 3) + b1 / 2;
    end
  end
end

function span = reach(terms, span)
% Longest span / 2^i for which the last term of the series is below rounding.
  for i = 1:60
    first = abs(terms(:, 1:14)) * (span .^ (0:13))';
    if all(abs(terms(:, end)) * span ^ 15 <= 1e-14 * first + 1e-300)
      return
    end
    span = span * 0.5;
  end
end

function course = course_of(m, s, b, terms, needed)
% Watched quantity b as a series.
  k = b - m.limits;
  if k <= 0
    course = watch(m, s, b, terms);
  elseif s.side(k) == 0
    course = needed(k, 1:m.n) * terms;
    course(1:2) = course(1:2) + needed(k, m.n + 1:end);
  else
    course = s.side(k) * terms(m.stopped(k), :);
  end
end

function [moment, side] = crossing(m, s, b, course, off, rate, span)
% First moment in (0, span] at which watched quantity b leaves its interval, or -1.
  course = fliplr(course);
  [low, high] = interval(m, s, b);
  moment = -1;
  side = 0;
  before = 0;
  f_before = course(end) + off;
  for quarter = 1:4
    now = 0.25 * quarter * span;
    f = polyval(course, now) + off * exp(-rate * now);
    slack = 1e-13 * (abs(f) + abs(f_before)) + 1e-300;
    if f > high + slack || f < low - slack
      side = 1;
      limit = high;
      if f < low - slack
        side = -1;
        limit = low;
      end
      left = before;
      moment = now;
      for i = 1:80
        half = 0.5 * (left + moment);
        if half <= left || half >= moment
          break
        end
        if (polyval(course, half) + off * exp(-rate * half) - limit) * side > 0
          moment = half;
        else
          left = half;
        end
      end
      return
    end
    before = now;
    f_before = f;
  end
end

function s = creep(m, s, span, value, slope)
% Through all events of a short span.
  time = 0;
  for event = 1:200
    [terms, off, rate, piece, needed] = series_at(m, s, value + slope * time, slope, span - time);
    which = 0;
    ports = zeros(1, m.channels);
    for b = [find(s.mode ~= 2), m.limits + find(m.stopped(:)')]
      fades = [off, ports; rate, ports];
      course = course_of(m, s, b, terms, needed);
      [moment, at_side] = crossing(m, s, b, course, fades(1, b), fades(2, b), piece);
      if moment >= 0
        piece = moment;
        which = b;
        side = at_side;
      end
    end
    s.x = terms * (piece .^ (0:15))';
    s.x(m.limited) = s.x(m.limited) + (off .* exp(-rate * piece))';
    time = time + piece;
    k = which - m.limits;
    if k > 0
      if s.side(k) == 0
        s.side(k) = -side; % friction pushes to `side`, and the mass yields to the other
      else
        s.x(m.stopped(k)) = 0;
        s = settle(m, s, k, value + slope * time);
      end
    elseif which > 0
      if s.mode(which) == 0
        ends = [m.low(which), m.high(which)];
        s.x(m.limited(which)) = ends(1 + (side > 0));
        s.mode(which) = side;
      else
        s.mode(which) = 0;
      end
    end
    if time >= span * (1 - 1e-12)
      return
    end
  end
  s.x(:) = NaN; % too many events: rather no result than a wrong one
end

function value = choose(condition, yes, no)
% One of two numbers.
  value = no;
  if condition
    value = yes;
  end
end

function [force, slope] = laws(side, z)
% Friction laws: force and its slope at every port. Of dry friction, what a mass feels that slides;
% on the wrong side of zero, the tangent goes on.
  force = zeros(size(z));
  slope = zeros(size(z));
@dispatch@
end

@laws@
