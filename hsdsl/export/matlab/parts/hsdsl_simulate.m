function r = hsdsl_simulate(m, p, x0, s)
% r = hsdsl_simulate(m, p, x0, s)  Follow a hybrid system from x0 at t = 0.
%
% m   the model, as NAME_model() gives it
% p   its parameters, as NAME_parameters() gives them
% x0  the mode's number and the states, as NAME_initial(p) gives them
% s   settings, m.settings when left out: scheme, step or tolerance (the other is 0), relaxation, until,
%     max_transitions
%
% r.t, r.j, r.x    rows: time, transitions made so far, and [mode; states], padded with zeros
% r.transitions    time, resumed, edge, source, target, before, after, entry
% r.stop, r.about  why the run ended, in a word and in a sentence
  if nargin < 4
    s = m.settings;
  end
  w = begin(m, p, s);
  q = x0(1);
  x = x0(2:m.dim(q) + 1);
  [w, here] = enter(w, q, x(:), 0, abs(x(:)), 0, [], []);
  while isempty(w.stop)
    if strcmp(s.scheme, 'relaxed')
      [w, here, event] = flow_relaxed(w, here);
    else
      [w, here, event] = flow_located(w, here);
    end
    if isempty(w.stop) && ~isempty(event)
      [w, here] = jump(w, here, event);
    end
  end
  table = vertcat(w.full{:}, w.table(1:w.rows, :));
  made = [w.earlier{:}, w.made];
  r = struct('t', table(:, 1), 'j', table(:, 2), 'x', table(:, 3:end), 'transitions', made, ...
             'stop', w.stop, 'about', w.about);
end

function w = begin(m, p, s)
% Everything that stays for a run, and room for what it writes.
  w = struct('m', m, 'p', p, 's', s, 'tab', m.method, 'stop', '', 'about', '', 'rows', 0, 'count', 0);
  w.largest = 0.1 * s.until;
  if s.tolerance > 0
    w.h = w.largest / 100;
  else
    w.h = s.step;
  end
  w.sizes = m.scale;
  w.full = {};
  w.table = zeros(128, 3 + max(m.dim));
  w.earlier = {};
  w.made = struct('time', {}, 'resumed', {}, 'edge', {}, 'source', {}, 'target', {}, 'before', {}, 'after', {}, ...
                  'entry', {});
  w.latest = -Inf * ones(1, 17);
  w.cascade = {};
  w.tail = struct('q', 0, 'k', 0, 'times', []);
  w.resting = false;
  w.creeping = 0;
end

function [w, here] = enter(w, q, x, t, scale, since, inside, reset_at)
% Enter a mode: transitions whose surface the state is beyond already are made at once.
  visited = {};
  while true
    w = row(w, t, q, x);
    here = struct('q', q, 'x', x, 't', t, 'k', segment(w.m, t), 'entered', x, 'scale', scale, ...
                  'active', [], 'passed', [], 'rest', 0);
    if w.m.final(q)
      w = ended(w, 'final', sprintf('entered mode %s at t = %.10g', w.m.mode_names{q}, t));
      return
    end
    if any(cellfun(@(v) isequal(v, [q; x]), visited))
      w = ended(w, 'zeno', sprintf('transitions on entry return to the same state at t = %.10g', t));
      return
    end
    visited{end + 1} = [q; x];
    d = w.m.data(here.k, :);
    values = w.m.surfaces{q}(t, x, w.p, d);
    then = values;
    if ~isempty(reset_at)
      then = w.m.surfaces{q}(reset_at, x, w.p, w.m.data(segment(w.m, reset_at), :));
    end
    edges = numel(w.m.edge_target{q});
    here.active = false(size(values));
    here.passed = false(size(values));
    beyond = [];
    for k = 1:numel(values)
      noise = roundoff(w, q, k, t, x, d, scale);
      if since > 0 && abs(values(k)) > noise
        noise = max(noise, abs(w.m.rate{q}{k}(t, x, w.p, d)) * since);
      end
      if values(k) > noise && ~(then(k) > noise)
        here.active(k) = true;
        here.passed(k) = w.m.rate{q}{k}(t, x, w.p, d) < 0;
      elseif values(k) > noise || (any(inside == k) && values(k) >= -noise)
        beyond(end + 1) = k;
      elseif values(k) >= -noise
        here.active(k) = true;
      end
    end
    if ~all(isfinite(values))
      w = ended(w, 'not_finite', sprintf('a surface of mode %s has no value at t = %.10g', w.m.mode_names{q}, t));
      return
    end
    firing = beyond(beyond <= edges);
    firing = firing(~w.m.edge_conditional{q}(firing));
    if isempty(firing)
      walls = beyond(beyond > edges);
      if ~isempty(walls)
        w = left(w, q, walls(1), t);
      end
      return
    end
    [unused, best] = max(w.m.edge_priority{q}(firing));
    k = firing(best);
    [w, after, scale] = reset(w, here, k, t, x, max(abs(x), scale));
    if ~isempty(w.stop)
      return
    end
    w = record(w, q, k, t, t, x, after, true);
    q = w.m.edge_target{q}(k);
    x = after;
    since = 0;
    inside = [];
    reset_at = [];
  end
end

function [w, after, scale] = reset(w, here, k, t, x, sizes)
% The state after a transition, and the sizes of the numbers that it was computed from.
  q = here.q;
  d = w.m.data(segment(w.m, t), :);
  after = w.m.reset{q}{k}(t, x, w.p, d);
  scale = w.m.spread{q}{k}(t, x, w.p, d, sizes);
  if ~all(isfinite(scale))
    scale = abs(after);
  elseif w.m.edge_target{q}(k) == q % resets that lose energy add round-off up, they do not magnify it
    changes = w.m.edge_changes{q}{k};
    had = w.sizes(w.m.state_index{q}(changes));
    scale(changes) = min(scale(changes), (w.count + 1) * max(abs(after(changes)), had));
  end
  if ~all(isfinite(after))
    w = ended(w, 'not_finite', sprintf('the reset of %s has no value at t = %.10g', w.m.edge_names{q}{k}, t));
  end
end

function w = record(w, q, k, t, resumed, x, after, entry)
% Write one transition down.
  if w.count >= w.s.max_transitions
    w = ended(w, 'transition_limit', sprintf('%d transitions at t = %.10g', w.count, t));
    return
  end
  target = w.m.edge_target{q}(k);
  if numel(w.made) == 128
    w.earlier{end + 1} = w.made;
    w.made = w.made([]);
  end
  w.count = w.count + 1;
  w.latest(mod(w.count, 17) + 1) = t;
  w.made(end + 1) = struct('time', t, 'resumed', resumed, 'edge', w.m.edge_names{q}{k}, ...
                           'source', w.m.mode_names{q}, 'target', w.m.mode_names{target}, ...
                           'before', x, 'after', after, 'entry', entry);
end

function sizes = sizes_along(here, x, z)
% The sizes of the numbers that a point of a step is computed from; a state that has not moved has those it came with.
  sizes = max(abs(x), abs(z));
  still = z == here.entered;
  sizes(still) = max(sizes(still), here.scale(still));
end

function w = row(w, t, q, x)
% Write a row down, into the last of several tables: to change a large one would be to copy it.
  if w.rows == size(w.table, 1)
    w.full{end + 1} = w.table;
    w.table(:) = 0;
    w.rows = 0;
  end
  w.rows = w.rows + 1;
  w.table(w.rows, 1:numel(x) + 3) = [t, w.count, q, x.'];
end

function w = ended(w, stop, about)
  w.stop = stop;
  w.about = about;
end

function w = left(w, q, k, t)
  wall = w.m.walls{q}{k - numel(w.m.edge_target{q})};
  w = ended(w, 'left_domain', sprintf('mode %s ends at %s, at t = %.10g', w.m.mode_names{q}, wall, t));
end

function k = segment(m, t)
% The number of the stretch of inputs that time is in; at a boundary the later one.
  k = max(1, find(m.starts <= t, 1, 'last'));
end

function dx = slope(w, q, t, x, d)
  dx = w.m.flow{q}(t, x, w.p, d);
end

function bound = roundoff(w, q, k, t, x, d, scale)
% Below this a surface value counts as zero.
  bound = w.m.roundoff(w.m, q, k, t, x, w.p, d, scale);
end

function scale = scale_of(here, k)
  scale = here.scale;
  if ~here.active(k)
    scale = 0 * scale;
  end
end

function here = leave(w, here, d)
% Forget the surfaces that the state was on and has left.
  for k = find(here.active(:) | here.passed(:)).'
    r = w.m.surfaces{here.q}(here.t, here.x, w.p, d);
    if abs(r(k)) > roundoff(w, here.q, k, here.t, here.x, d, scale_of(here, k))
      here.active(k) = false;
    end
    if here.passed(k) && (r(k) <= 0 || ~(w.m.rate{here.q}{k}(here.t, here.x, w.p, d) < 0))
      here.passed(k) = false;
    end
  end
end

function yes = holds(w, q, k, t, x, d)
% Whether the condition of an edge holds.
  yes = true;
  parts = w.m.condition{q}{k};
  for i = 1:numel(parts)
    if ~parts{i}(t, x, w.p, d)
      yes = false;
      return
    end
  end
end

function since = tie(t)
% Times closer than this to t are the same instant.
  since = 1e-12 * abs(t);
end

function found = on_guard(w, here, t, x, since)
% Edges on whose guards the state is, with the flow pointing out.
  q = here.q;
  d = w.m.data(here.k, :);
  found = [];
  values = w.m.surfaces{q}(t, x, w.p, d);
  for k = 1:numel(w.m.edge_target{q})
    rate = w.m.rate{q}{k}(t, x, w.p, d);
    near = max(roundoff(w, q, k, t, x, d, scale_of(here, k)), rate * since);
    if abs(values(k)) <= near && rate > 0 && holds(w, q, k, t, x, d)
      found(end + 1) = k;
    end
  end
end

function [z, K] = step(w, q, t, h, x, k1, d)
% One step: its end, and the slopes of its stages (of an implicit method, the increments of the state).
  tab = w.tab;
  if tab.implicit
    [z, K] = implicit_step(w, q, t, h, x, k1, d);
    return
  end
  K = zeros(numel(x), tab.stages);
  K(:, 1) = k1;
  for i = 2:tab.stages
    K(:, i) = slope(w, q, t + tab.c(i) * h, x + h * (K(:, 1:i - 1) * tab.a(i, 1:i - 1).'), d);
  end
  z = x + h * (K * tab.b);
end

function [z, Z] = implicit_step(w, q, t, h, x, k1, d)
% Collocation, solved by Newton's method with one matrix.
  tab = w.tab;
  n = numel(x);
  stages = numel(tab.c);
  J = w.m.jacobian{q}(t, x, w.p, d);
  M = eye(n * stages) - h * kron(tab.a, J);
  Z = h * k1 * tab.c.';
  size_of = max(abs(x), abs(h * k1)) + realmin;
  best = Inf;
  for round = 1:60
    F = zeros(n, stages);
    for i = 1:stages
      F(:, i) = slope(w, q, t + tab.c(i) * h, x + Z(:, i), d);
    end
    change = reshape(M \ reshape(Z - h * (F * tab.a.'), [], 1), n, stages);
    Z = Z - change;
    worst = max(max(abs(change) ./ repmat(max(size_of, abs(Z(:, end))), 1, stages)));
    if ~(worst < Inf)
      break
    end
    if worst < 1e-14 || (worst < 1e-10 && worst >= best)
      break
    end
    best = min(best, worst);
  end
  z = x + Z(:, end);
end

function C = piece(w, q, t, h, x, z, K, k1, k2, d)
% The step's interpolant: x + C * [s; s^2; ...] for s from 0 to 1.
  tab = w.tab;
  if tab.implicit
    C = K * tab.dense;
  elseif strcmp(tab.interpolant, 'secant')
    C = z - x;
  elseif strcmp(tab.interpolant, 'hermite')
    C = hermite(h, x, z, k1, k2);
  else
    K(:, tab.stages + 1) = k2;
    for i = tab.stages + 2:tab.stages + 1 + tab.extra
      K(:, i) = slope(w, q, t + tab.c(i) * h, x + h * (K(:, 1:i - 1) * tab.a(i, 1:i - 1).'), d);
    end
    C = h * (K * tab.dense);
  end
end

function C = hermite(h, x, z, k1, k2)
  C = [h * k1, 3 * (z - x) - h * (2 * k1 + k2), h * (k1 + k2) - 2 * (z - x)];
end

function y = along(x, C, s)
  y = x + C * (s .^ (1:size(C, 2)).');
end

function ratio = error_ratio(w, q, t, h, x, z, K, k1, k2, d)
% The estimate of the step's error, as a multiple of what is allowed.
  tab = w.tab;
  if tab.implicit
    J = w.m.jacobian{q}(t, x, w.p, d);
    e = (tab.gamma / h * eye(numel(x)) - J) \ (k1 + K * tab.estimate / h);
  else
    K(:, tab.stages + 1) = k2;
    e = h * (K * tab.error);
    if ~isempty(tab.coarse)
      c = h * (K * tab.coarse);
      e = e .^ 2 ./ max(realmin, sqrt(e .^ 2 + c .^ 2 / 100));
    end
  end
  had = w.sizes(w.m.state_index{q});
  sizes = max(max(had, abs(z)), realmin);
  tiny = h <= max(w.s.tolerance, 1e-8) * w.largest & had <= w.s.tolerance * abs(z);
  e(tiny) = 0;
  ratio = max([0; abs(e) ./ (w.s.tolerance * sizes)]);
  if ratio > 1
    sizes = max(resolved(w, q, t, h, x, k1, d, max(had, realmin)), abs(z));
    ratio = max([0; abs(e) ./ (w.s.tolerance * sizes)]);
  end
  if ~isfinite(ratio)
    ratio = Inf;
  end
end

function scales = resolved(w, q, t, h, x, k1, d, scales)
% The scales of states, none below a share of what the terms of its flow could move it by in a step: a flow that is a
% small difference of large terms is no more than their round-off. What the last digits change tells their size.
  unit = eps / 2;
  n = numel(x);
  moved = scales;
  lifted = false(n, 1);
  moves = [2; -2; 6; -6];
  for round = 1:n
    change = zeros(n, 1);
    for i = 0:3
      by = unit * moves(mod(floor((0:n).' / 4^i) + i, 4) + 1);
      change = max(change, abs(slope(w, q, t + by(end) * t, x + by(1:n) .* moved, d) - k1));
    end
    least = h * change / (4 * unit);
    more = isfinite(least) & least > 32 * scales;
    moved(more) = max(moved(more), least(more));
    if ~any(more & ~lifted)
      break
    end
    lifted = lifted | more;
  end
  scales = max(scales, moved / 32);
end

function [w, ok, h] = controlled(w, h, ratio)
% Accept or reject a step by its error, and choose the next one.
  order = w.tab.error_order;
  if ratio == 0
    factor = 5;
  else
    factor = min(5, max(0.2, 0.9 * ratio ^ (-1 / order)));
  end
  ok = ratio <= 1;
  if ok
    proposed = h * factor;
    if h < w.h
      proposed = max(proposed, w.h);
    end
    w.h = min(w.largest, proposed);
  else
    w.h = h * min(1, factor);
    h = w.h;
  end
end

function w = seen(w, q, x)
  index = w.m.state_index{q};
  w.sizes(index) = max(w.sizes(index), abs(x));
end

function [w, here, event, done] = boundary(w, here)
% At the end of a stretch of inputs: the end of the run, or the next stretch.
  event = [];
  done = true;
  t = here.t;
  x = here.x;
  q = here.q;
  if t >= w.s.until && here.k >= numel(w.m.ends)
    found = setdiff(on_guard(w, here, t, x, tie(t)), here.rest);
    if ~isempty(found)
      [unused, best] = max(w.m.edge_priority{q}(found));
      if ~strcmp(w.s.scheme, 'relaxed')
        event = struct('k', found(best), 't', t, 'x', x, 'depth', 0, 't1', t, 'sizes', sizes_along(here, x, x));
        return
      end
      w = record(w, q, found(best), t, NaN, x, [], false);
    end
    w = ended(w, 'until', sprintf('reached t = %.10g', t));
    return
  end
  if w.m.jumps(segment(w.m, t))
    d = w.m.data(here.k, :);
    values = w.m.surfaces{q}(t, x, w.p, d);
    inside = [];
    for k = 1:numel(w.m.edge_target{q})
      plain = ~w.m.edge_conditional{q}(k);
      if plain && values(k) < -roundoff(w, q, k, t, x, d, scale_of(here, k))
        inside(end + 1) = k;
      end
    end
    [w, here] = enter(w, q, x, t, here.scale, 0, inside, []);
  else
    here.k = segment(w.m, t);
    done = false;
  end
end

function [w, here, event] = flow_located(w, here)
% Step until a surface is crossed, or the stretch of inputs ends.
  event = [];
  w = seen(w, here.q, here.x);
  while isempty(w.stop)
    limit = w.m.ends(here.k);
    if here.t >= limit
      [w, here, event, done] = boundary(w, here);
      if done
        return
      end
      continue
    end
    q = here.q;
    d = w.m.data(here.k, :);
    t = here.t;
    x = here.x;
    if here.rest > 0
      [w, here, event] = rest(w, here);
      if ~isempty(event)
        return
      end
      continue
    end
    k1 = slope(w, q, t, x, d);
    if ~all(isfinite(k1))
      w = ended(w, 'not_finite', sprintf('the flow of mode %s has no value at t = %.10g', w.m.mode_names{q}, t));
      return
    end
    h = w.h;
    halvings = 0;
    while true
      if h < (limit - t) * (1 - 2 ^ -30)
        t1 = t + h;
      else
        h = limit - t;
        t1 = limit;
      end
      [z, K] = step(w, q, t, h, x, k1, d);
      k2 = slope(w, q, t1, z, d);
      values = w.m.surfaces{q}(t1, z, w.p, d);
      good = all(isfinite(z)) && all(isfinite(k2)) && all(isfinite(values));
      if good
        if ~(w.s.tolerance > 0)
          break
        end
        [w, ok, tried] = controlled(w, h, error_ratio(w, q, t, h, x, z, K, k1, k2, d));
        if ok
          break
        end
        h = tried;
      else
        h = h / 2;
        halvings = halvings + 1;
      end
      if halvings > 120 || ~(t + h > t)
        found = on_guard(w, here, t, x, tie(t));
        if isempty(found)
          w = underflow(w, here, good);
        else
          [unused, best] = max(w.m.edge_priority{q}(found));
          event = struct('k', found(best), 't', t, 'x', x, 'depth', 0, 't1', t, ...
                         'sizes', sizes_along(here, x, x));
        end
        return
      end
    end
    if ~clear_of_all(w, q, t, h, x, z, values, d)
      C = piece(w, q, t, h, x, z, K, k1, k2, d);
      event = first_crossing(w, here, t, h, x, k1, z, C, values, d);
    end
    if isempty(event)
      here.t = t1;
      here.x = z;
      w = row(w, t1, q, z);
      w = seen(w, q, z);
      w.cascade = {};
      here = leave(w, here, d);
    else
      if event.t > t
        w.cascade = {};
        w = row(w, event.t, q, event.x);
        w = seen(w, q, event.x);
      end
      if event.k > numel(w.m.edge_target{q})
        w = left(w, q, event.k, event.t);
      end
      return
    end
  end
end

function event = first_crossing(w, here, t, h, x, k1, z, C, ends_at, d)
% The earliest crossing along a step; tied with others, that of the highest priority.
  event = [];
  q = here.q;
  count = numel(ends_at);
  pieces = 8;
  s = (0:pieces) / pieces;
  R = zeros(count, pieces + 1);
  R(:, 1) = w.m.surfaces{q}(t, x, w.p, d);
  for i = 2:pieces
    R(:, i) = w.m.surfaces{q}(t + s(i) * h, along(x, C, s(i)), w.p, d);
  end
  R(:, end) = ends_at;
  edges = numel(w.m.edge_target{q});
  found = zeros(0, 2);
  states = {};
  for k = 1:count
    nodes = s;
    r = R(k, :);
    [top, i] = max(r);
    if top <= 0 && i > 1 && i < numel(r)
      bend = r(i - 1) - 2 * r(i) + r(i + 1);
      at = nodes(i);
      if bend < 0
        at = at + (r(i - 1) - r(i + 1)) / (2 * bend) / pieces;
      end
      peak = w.m.surfaces{q}(t + at * h, along(x, C, at), w.p, d);
      if peak(k) > 0
        if at < nodes(i)
          i = i - 1;
        end
        nodes = [nodes(1:i), at, nodes(i + 1:end)];
        r = [r(1:i), peak(k), r(i + 1:end)];
      end
    end
    if max(r) <= 0
      continue
    end
    noise = roundoff(w, q, k, t + h, z, d, scale_of(here, k));
    first_noise = roundoff(w, q, k, t, x, d, scale_of(here, k));
    for i = 1:numel(r) - 1
      bound = noise;
      if i == 1
        bound = first_noise;
      end
      if r(i) > bound || ~(r(i + 1) > noise)
        continue
      end
      [share, y] = root(w, q, k, t, h, x, k1, z, d, nodes(i), nodes(i + 1), r(i), noise);
      if isempty(share)
        continue
      end
      if k > edges || holds(w, q, k, t + share * h, y, d) || stays(w, q, k, t + share * h, y, d)
        found(end + 1, :) = [share, k];
        states{end + 1} = y;
        break
      end
    end
  end
  if isempty(found)
    return
  end
  [share, first] = min(found(:, 1));
  time = t + share * h;
  y = states{first};
  tied = found((found(:, 1) - share) * h <= tie(time), 2).';
  tied = unique([tied, on_guard(w, here, time, y, tie(time))]);
  fires = tied(tied <= edges);
  if isempty(fires)
    k = tied(1);
  else
    [unused, best] = max(w.m.edge_priority{q}(fires));
    k = fires(best);
  end
  sizes = sizes_along(here, x, y);
  if share > 0
    sizes = max(max(sizes, abs(z)), max(abs(C), [], 2));
  end
  event = struct('k', k, 't', time, 'x', y, 'depth', 0, 't1', time, 'sizes', sizes);
end

function yes = clear_of_all(w, q, t, h, x, z, after, d)
% Whether each surface, as the cubic of its values and rates at a step's ends, stays below zero by as much as it varies.
  before = w.m.surfaces{q}(t, x, w.p, d);
  yes = false;
  for k = 1:numel(after)
    if ~(before(k) < 0 && after(k) < 0)
      return
    end
    from = h * w.m.rate{q}{k}(t, x, w.p, d) / 3;
    to = h * w.m.rate{q}{k}(t + h, z, w.p, d) / 3;
    hull = [before(k), before(k) + from, after(k) - to, after(k)];
    if ~(2 * max(hull) - min(hull) < 0)
      return
    end
  end
  yes = true;
end

function [share, y] = root(w, q, k, t, h, x, k1, z, d, a, b, low, noise)
% Where a surface rises through zero, as a share of the step: on steps that end there.
  y = [];
  share = [];
  inward = a == 0 && abs(low) <= noise && ~w.resting && w.m.rate{q}{k}(t, x, w.p, d) < 0;
  if low > 0 && a == 0 && ~inward
    share = 0;
    y = x;
    return
  end
  [fb, yb] = at_share(w, q, k, t, h, x, k1, z, d, b);
  while ~(fb > 0) && b < 1
    b = min(1, 2 * b);
    [fb, yb] = at_share(w, q, k, t, h, x, k1, z, d, b);
  end
  if ~(fb > 0)
    return
  end
  [fa, ya] = at_share(w, q, k, t, h, x, k1, z, d, a);
  if inward
    % the flow leads inside from the surface, and back to it between these two points
    c = b;
    for round = 1:60
      c = c / 2;
      [f, y] = at_share(w, q, k, t, h, x, k1, z, d, c);
      if f < 0
        a = c;
        fa = f;
        ya = y;
        break
      end
      b = c;
      fb = f;
      yb = y;
    end
  end
  if fa > 0 && fa <= noise
    share = a;
    y = ya;
    return
  end
  if fa > 0
    a = 0;
    ya = x;
    fa = 0;
  end
  value = @(c) at_share(w, q, k, t, h, x, k1, z, d, c);
  [share, y] = close_bracket(value, a, fa, ya, b, fb, yb, noise / 16);
end

function [s, y] = close_bracket(value, a, fa, ya, b, fb, yb, small)
% Where a value rises through zero between a and b (regula falsi, Illinois variant), and the state there.
  wa = fa;
  wb = fb;
  side = 0;
  for round = 1:200
    if -fa <= small || b - a <= 4 * eps
      break
    end
    if fb <= small
      a = b;
      ya = yb;
      break
    end
    c = b - wb * (b - a) / (wb - wa);
    if ~(a < c && c < b)
      c = (a + b) / 2;
    end
    [f, y] = value(c);
    if f <= 0
      if side < 0
        wb = wb / 2;
      end
      a = c;
      fa = f;
      ya = y;
      wa = f;
      side = -1;
    else
      if side > 0
        wa = wa / 2;
      end
      b = c;
      fb = f;
      yb = y;
      wb = f;
      side = 1;
    end
  end
  s = a;
  y = ya;
end

function [value, y] = at_share(w, q, k, t, h, x, k1, z, d, share)
% A surface at a share of a step: on a step of that length, or on the straight line of methods of order 1 and 2.
  if share == 0 || w.resting
    y = x;
  elseif share == 1
    y = z;
  elseif strcmp(w.tab.interpolant, 'secant') && ~w.tab.implicit
    y = x + share * (z - x);
  else
    y = step(w, q, t, share * h, x, k1, d);
  end
  values = w.m.surfaces{q}(t + share * h, y, w.p, d);
  value = values(k);
end

function [w, here] = jump(w, here, event)
% Make a transition: at once, or in a strip.
  q = here.q;
  k = event.k;
  relaxed = strcmp(w.s.scheme, 'relaxed');
  if stays(w, q, k, event.t, event.x, w.m.data(segment(w.m, event.t), :))
    here.t = event.t;
    here.x = event.x;
    here.rest = k;
    return
  end
  if w.count >= w.s.max_transitions
    w = ended(w, 'transition_limit', sprintf('%d transitions at t = %.10g', w.count, event.t));
    return
  end
  [w, after, scale] = reset(w, here, k, event.t, event.x, max(abs(event.x), event.sizes));
  if ~isempty(w.stop)
    return
  end
  target = w.m.edge_target{q}(k);
  resumed = event.t;
  returned = any(cellfun(@(v) isequal(v, [target; after]), w.cascade));
  if relaxed
    resumed = event.t1 + (w.s.relaxation - event.depth);
  end
  if returned && target ~= q && ~(relaxed && taken_back(w, q, event, target, after))
    w = ended(w, 'zeno', sprintf('transitions return to the same state at t = %.10g: sliding', event.t));
    return
  end
  if ~relaxed && (returned || crowded(w, event.t))
    resumed = event.t + w.s.relaxation;
  end
  w.cascade{end + 1} = [target; after];
  if resumed > w.s.until + tie(w.s.until)
    w = record(w, q, k, event.t, NaN, event.x, [], false);
    w = row(w, w.s.until, q, event.x);
    w = ended(w, 'until', sprintf('reached t = %.10g in the strip of %s', w.s.until, w.m.edge_names{q}{k}));
    return
  end
  resumed = min(resumed, w.s.until);
  if resumed > event.t
    w = row(w, resumed, q, event.x);
  end
  w = record(w, q, k, event.t, resumed, event.x, after, false);
  if relaxed
    [w, here] = enter(w, target, after, resumed, scale, 0, [], event.t);
  else
    [w, here] = enter(w, target, after, resumed, scale, tie(event.t), [], []);
    w = flight(w, q, k, target, event.t);
    if isempty(w.stop) && here.q == q
      [w, here] = close_tail(w, here, k);
    end
  end
end

function yes = taken_back(w, q, event, target, after)
% Whether the flows of two modes undo each other.
  one = slope(w, q, event.t, event.x, w.m.data(segment(w.m, event.t), :));
  other = slope(w, target, event.t, after, w.m.data(segment(w.m, event.t), :));
  yes = numel(one) == numel(other) && opposite(one, other, 0 * one);
end

function yes = opposite(one, other, noise)
% Whether one direction is opposite to another that is not zero.
  yes = false;
  if ~any(one)
    return
  end
  [unused, i] = max(abs(one));
  share = other(i) / one(i);
  yes = share < 0 && all(abs(other - share * one) <= 1e-6 * abs(share) * abs(one) + noise);
end

function w = flight(w, q, k, target, t)
% Remember when one edge from a mode to itself was made, again and again.
  if w.tail.q ~= q || w.tail.k ~= k || target ~= q
    w.tail = struct('q', q, 'k', k, 'times', []);
  end
  w.tail.times = [w.tail.times(max(1, end - 7):end), t];
end

function [w, here] = close_tail(w, here, k)
% Flights that shrink by a ratio are nearly over when what is left is below the relaxation: go to their limit.
  flights = diff(w.tail.times);
  if numel(flights) < 3 || ~all(flights > 0)
    return
  end
  flights = flights(end - 2:end);
  ratio = max(flights(2:end) ./ flights(1:end - 1));
  left_over = flights(end) * ratio / (1 - ratio);
  time = here.t + left_over;
  if ratio >= 1 || left_over > w.s.relaxation || time > w.m.ends(here.k)
    return
  end
  q = here.q;
  d = w.m.data(here.k, :);
  x = here.x;
  for round = 1:60
    one = reset_but_counts(w, q, k, time, x, d);
    if isequal(one, x)
      break
    end
    two = reset_but_counts(w, q, k, time, one, d);
    bend = two - 2 * one + x;
    next = two;
    next(bend ~= 0) = x(bend ~= 0) - (one(bend ~= 0) - x(bend ~= 0)) .^ 2 ./ bend(bend ~= 0);
    x = next;
  end
  before = w.m.surfaces{q}(here.t, here.x, w.p, d);
  after = w.m.surfaces{q}(time, x, w.p, d);
  for i = 1:numel(after)
    noise = roundoff(w, q, i, time, x, d, here.scale);
    if (i == k && abs(after(i)) > noise) || (i ~= k && after(i) > noise && ~(before(i) > noise))
      return
    end
  end
  [kept, pushed] = held(w, q, k, time, x, d);
  if kept
    w = row(w, time, q, x);
    here.t = time;
    here.x = x;
    here.rest = k;
    here.active(k) = true;
  elseif pushed
    w = ended(w, 'zeno', sprintf('transitions of %s accumulate at t = %.10g, and something moves on', ...
                                 w.m.edge_names{q}{k}, time));
  end
end

function [yes, pushed] = held(w, q, k, t, x, d)
% Whether the reset of edge k keeps a state on its guard in place while the flow pushes it out, and moves nothing else.
  yes = false;
  sizes = max(w.sizes(w.m.state_index{q}), abs(x));
  noise = 4 * eps * sizes;
  f = slope(w, q, t, x, d);
  after = reset_but_counts(w, q, k, t, x, d);
  pushed = all(abs(after - x) <= noise) && any(f) && all(isfinite(f)) && possible(w, q, k, t, x, f, sizes, d);
  if ~pushed
    return
  end
  moving = f ~= 0 & sizes > 0;
  small = sqrt(eps) * min([w.s.until; sizes(moving) ./ abs(f(moving))]);
  rate = w.m.rate{q}{k}(t, x, w.p, d);
  slopes = w.m.gradient{q}{k}(t, x, w.p, d);
  if abs(rate) <= 16 * eps * sum(abs(slopes(2:end)) .* max(abs(f), sizes / w.s.until))
    rate = (w.m.rate{q}{k}(t + small, x + small * f, w.p, d) - rate) / small;
  end
  pushed = rate > 0;
  ahead = x + small * f;
  yes = pushed && opposite(f, reset_but_counts(w, q, k, t, ahead, d) - ahead, noise);
end

function yes = stays(w, q, k, t, x, d)
% Whether a run by the located scheme rests on the guard of edge k from here on.
  yes = ~strcmp(w.s.scheme, 'relaxed') && w.m.edge_target{q}(k) == q && held(w, q, k, t, x, d);
end

function after = reset_but_counts(w, q, k, t, x, d)
% What the reset of edge k makes of a state at a slow impact, but for states that it counts with.
  after = w.m.slow{q}{k}(t, x, w.p, d);
  counts = w.m.edge_counts{q}{k};
  after(counts) = x(counts);
end

function yes = possible(w, q, k, t, x, f, sizes, d)
% Whether the `if` of edge k holds at a point, or next along the flow f: off by round-off where the reset moves it.
  yes = holds(w, q, k, t, x, d);
  if ~yes
    ahead = x + sqrt(eps) * f;
    moved = reset_but_counts(w, q, k, t, ahead, d) ~= ahead & f ~= 0;
    after = max([0; 16 * eps * sizes(moved) ./ abs(f(moved))]);
    if after == 0 % these states have been zero only
      after = eps * w.s.until;
    end
    yes = holds(w, q, k, t, x + after * f, d);
  end
end

function [w, here, event] = rest(w, here)
% Hold a state at rest until its guard lets it go, or another surface comes to it.
  q = here.q;
  d = w.m.data(here.k, :);
  t = here.t;
  x = here.x;
  h = min(w.largest, w.m.ends(here.k) - t);
  looks = t + h * (0:8) / 8;
  looks(end) = t + h;
  last = 9;
  for i = 2:9
    if ~held(w, q, here.rest, looks(i), x, d)
      last = i;
      break
    end
  end
  released = ~held(w, q, here.rest, looks(last), x, d);
  low = looks(last - 1);
  t1 = looks(last);
  while released && low < (low + t1) / 2 && (low + t1) / 2 < t1
    middle = (low + t1) / 2;
    if held(w, q, here.rest, middle, x, d)
      low = middle;
    else
      t1 = middle;
    end
  end
  w.resting = true;
  values = w.m.surfaces{q}(t1, x, w.p, d);
  event = first_crossing(w, here, t, t1 - t, x, 0 * x, x, 0 * x, values, d);
  w.resting = false;
  if ~isempty(event)
    w = row(w, event.t, q, x);
    if event.k > numel(w.m.edge_target{q})
      w = left(w, q, event.k, event.t);
    end
    return
  end
  here.t = t1;
  w = row(w, t1, q, x);
  if released
    here.rest = 0;
    here.active(:) = abs(values) <= 1e-12 * max(1, abs(values));
  end
end

function yes = crowded(w, t)
% Whether more than 16 transitions fell within the relaxation.
  yes = w.count > 16 && t - w.latest(mod(w.count + 1, 17) + 1) < w.s.relaxation;
end

function [w, here, event] = flow_relaxed(w, here)
% Step until a step ends in a strip, or the stretch of inputs ends (Burden et al. 2013, Fig. 12).
  event = [];
  w = seen(w, here.q, here.x);
  while isempty(w.stop)
    limit = w.m.ends(here.k);
    if here.t >= limit
      [w, here, event, done] = boundary(w, here);
      if done
        return
      end
      continue
    end
    q = here.q;
    d = w.m.data(here.k, :);
    t = here.t;
    x = here.x;
    k1 = slope(w, q, t, x, d);
    h = w.h;
    halvings = 0;
    wall = 0;
    while true
      if h < (limit - t) * (1 - 2 ^ -30)
        t1 = t + h;
      else
        h = limit - t;
        t1 = limit;
      end
      [z, K] = step(w, q, t, h, x, k1, d);
      [inside, found, wall] = judge(w, here, t, h, t1, x, k1, z, K, d);
      good = inside || ~isempty(found);
      wrong = false;
      if good && w.s.tolerance > 0
        k2 = slope(w, q, t1, z, d);
        if all(isfinite(k2))
          ratio = error_ratio(w, q, t, h, x, z, K, k1, k2, d);
          if ratio > 1 && halvings == 0
            [w, good, h] = controlled(w, h, ratio);
            wrong = true;
          elseif ratio > 1
            good = false;
          elseif halvings == 0
            w = controlled(w, h, ratio);
          end
        end
      end
      if good
        break
      end
      if ~wrong
        h = h / 2;
        halvings = halvings + 1;
      end
      if halvings > 122 || ~(t + h > t)
        [w, event] = stuck(w, here, wall);
        return
      end
    end
    if ~isempty(found)
      event = choose(w, here, found, t1, z);
      if event.t > t
        w = row(w, event.t, q, event.x);
        w.cascade = {};
      end
      return
    end
    w.creeping = (w.creeping + 1) * (halvings > 9);
    if w.creeping > 500
      [w, event] = stuck(w, here, wall);
      return
    end
    here.t = t1;
    here.x = z;
    w = row(w, t1, q, z);
    w = seen(w, q, z);
    w.cascade = {};
    here = leave(w, here, d);
  end
end

function [w, event] = stuck(w, here, wall)
% No step, however short, stays in the relaxed domain: take a guard that the state is on, or stop.
  event = [];
  found = on_guard(w, here, here.t, here.x, tie(here.t));
  if ~isempty(found)
    [unused, best] = max(w.m.edge_priority{here.q}(found));
    event = struct('k', found(best), 't', here.t, 'x', here.x, 'depth', 0, 't1', here.t, ...
                   'sizes', strip_sizes(here, here.x, here.x, found(best)));
  elseif wall > 0
    w = left(w, here.q, wall, here.t);
  else
    d = w.m.data(here.k, :);
    ahead = here.t + w.h;
    y = here.x + w.h * slope(w, here.q, here.t, here.x, d);
    w = underflow(w, here, all(isfinite([y; slope(w, here.q, ahead, y, d); w.m.surfaces{here.q}(ahead, y, w.p, d)])));
  end
end

function w = underflow(w, here, finite)
% No step is short enough: say why.
  if finite
    w = ended(w, 'step_underflow', sprintf('no step is short enough at t = %.10g', here.t));
  else
    w = ended(w, 'not_finite', sprintf('mode %s has no value beyond t = %.10g', w.m.mode_names{here.q}, here.t));
  end
end

function sizes = strip_sizes(here, x, z, k)
% Those of a point on the guard of edge k: one that the state has not left it is off by the round-off of what it came with.
  sizes = sizes_along(here, x, z);
  if here.active(k)
    sizes = max(sizes, here.scale);
  end
end

function event = choose(w, here, found, t1, z)
% Of several crossings the earliest; of tied ones the highest priority, then the file's order.
  [time, first] = min([found.t]);
  tied = [found([found.t] - time <= tie(time)).k];
  tied = unique([tied, on_guard(w, here, time, found(first).x, tie(time))]);
  [unused, best] = max(w.m.edge_priority{here.q}(tied));
  k = tied(best);
  depth = found(first).depth;
  same = find([found.k] == k, 1);
  if ~isempty(same)
    depth = found(same).depth;
  end
  if found(first).share == 0
    z = here.x;
  end
  event = struct('k', k, 't', time, 'x', found(first).x, 'depth', depth, 't1', t1, ...
                 'sizes', strip_sizes(here, here.x, z, k));
end

function [inside, found, wall] = judge(w, here, t, h, t1, x, k1, z, K, d)
% Whether a step's end is in the domain, or in strips: the crossings; neither is a step to halve.
  q = here.q;
  inside = false;
  wall = 0;
  found = struct('k', {}, 't', {}, 'x', {}, 'depth', {}, 'share', {});
  values = w.m.surfaces{q}(t1, z, w.p, d);
  if ~all(isfinite(z)) || ~all(isfinite(values))
    return
  end
  k2 = slope(w, q, t1, z, d);
  finite = all(isfinite(k2));
  noise = zeros(size(values));
  beyond = [];
  for k = find(values(:) > 0).'
    noise(k) = roundoff(w, q, k, t1, z, d, scale_of(here, k));
    if values(k) > noise(k)
      beyond(end + 1) = k;
    end
  end
  edges = numel(w.m.edge_target{q});
  walls = beyond(beyond > edges);
  walls = walls(~here.passed(walls));
  if ~isempty(walls)
    wall = walls(1);
    return
  end
  for k = beyond(beyond <= edges)
    free = here.passed(k) || w.m.edge_conditional{q}(k);
    if ~free && too_deep(w, q, k, t1, z, d, values(k), noise(k))
      return
    end
  end
  if finite
    C = piece(w, q, t, h, x, z, K, k1, k2, d);
  else
    C = z - x;
  end
  for k = beyond(beyond <= edges)
    [ok, one] = strip_crossing(w, here, k, t, h, t1, x, k1, z, k2, C, finite, d, values(k), noise(k));
    if ~ok
      found = found([]);
      return
    end
    found = [found, one];
  end
  inside = isempty(found) && finite;
end

function deep = too_deep(w, q, k, t1, z, d, value, noise)
  norm_of = norm(w.m.gradient{q}{k}(t1, z, w.p, d));
  deep = ~(norm_of > 0) || ~(value <= w.s.relaxation * norm_of + noise);
end

function [ok, one] = strip_crossing(w, here, k, t, h, t1, x, k1, z, k2, C, finite, d, value, noise)
% The last crossing of a surface along a step that ends beyond it; none where the surface is transparent there.
  q = here.q;
  one = struct('k', {}, 't', {}, 'x', {}, 'depth', {}, 'share', {});
  ok = true;
  small = max(roundoff(w, q, k, t, x, d, 0 * x), roundoff(w, q, k, t1, z, d, 0 * x)) / 16;
  share = last_rise(w, q, k, t, h, x, C, d, small);
  if isempty(share)
    free = here.passed(k) || w.m.edge_conditional{q}(k);
    start = w.m.surfaces{q}(t, x, w.p, d);
    if free && start(k) > roundoff(w, q, k, t, x, d, scale_of(here, k))
      return
    end
    share = 0;
  end
  norm_of = norm(w.m.gradient{q}{k}(t1, z, w.p, d));
  time = t + share * h;
  y = along(x, C, share);
  back = -w.m.rate{q}{k}(time, y, w.p, d) * h;
  if back > noise && back <= w.s.relaxation * norm_of && finite
    C = hermite(h, x, z, k1, k2);
    share = last_rise(w, q, k, t, h, x, C, d, small);
    if isempty(share)
      share = 0;
    end
    time = t + share * h;
    y = along(x, C, share);
    back = -w.m.rate{q}{k}(time, y, w.p, d) * h;
  end
  if back > noise
    ok = false;
    return
  end
  on = share == 0 || here.active(k);
  if ~holds(w, q, k, time, y, d) && ~(on && holds_next(w, here, k, t, h, x, C, share, value, d))
    return
  end
  if too_deep(w, q, k, t1, z, d, value, noise)
    ok = false;
    return
  end
  for i = 1:7
    s = share + (1 - share) * i / 8;
    r = w.m.surfaces{q}(t + s * h, along(x, C, s), w.p, d);
    if r(k) > value + noise
      ok = false;
      return
    end
  end
  one = struct('k', k, 't', time, 'x', y, 'depth', min(w.s.relaxation, value / norm_of), 'share', share);
end

function yes = holds_next(w, here, k, t, h, x, C, share, value, d)
% Whether the `if` of an edge holds next, on whose surface the state is: where a hop ends that round-off hides.
  q = here.q;
  yes = w.m.edge_target{q}(k) == q;
  if ~yes
    return
  end
  back = -w.m.rate{q}{k}(t + share * h, along(x, C, share), w.p, d) * h;
  if back > 0
    share = share + (1 - share) * (back / (back + value));
  end
  y = along(x, C, share);
  sizes = max(w.sizes(w.m.state_index{q}), abs(y));
  yes = possible(w, q, k, t + share * h, y, slope(w, q, t + share * h, y, d), sizes, d);
end

function share = last_rise(w, q, k, t, h, x, C, d, small)
% The last share of a step at which a surface rises through zero along its interpolant; empty where it never does.
  share = [];
  b = 1;
  fb = on_piece(w, q, k, t, h, x, C, d, 1);
  for i = 7:-1:0
    a = i / 8;
    fa = on_piece(w, q, k, t, h, x, C, d, a);
    if fa <= 0
      break
    end
    b = a;
    fb = fa;
  end
  if fa > 0
    return
  end
  value = @(c) on_piece(w, q, k, t, h, x, C, d, c);
  share = close_bracket(value, a, fa, [], b, fb, [], small);
end

function [value, y] = on_piece(w, q, k, t, h, x, C, d, s)
  y = along(x, C, s);
  values = w.m.surfaces{q}(t + s * h, y, w.p, d);
  value = values(k);
end
