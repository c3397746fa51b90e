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
  [w, here] = enter(w, q, x(:), 0, start_sizes(w, q, x(:)), arrival_of(0, []));
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
  w.last = struct('time', {}, 'resumed', {}, 'q', {}, 'k', {}, 'target', {}, 'entry', {});
  w.cascade = struct('reference', [], 'length', 0, 'room', 1);
  w.creeping = 0;
end

function arrival = arrival_of(since, reset_at)
% How a state comes to a mode: the time within which it is on surfaces, and when it was reset before it waited.
  arrival = struct('since', since, 'reset_at', reset_at, 'inside', [], 'stood', []);
end

function [w, here] = enter(w, q, x, t, scale, arrival)
% Enter a mode: transitions whose surface the state is beyond already are made at once.
  visited = {};
  while true
    w = row(w, t, q, x);
    here = struct('q', q, 'owner', q, 'x', x, 't', t, 'k', segment(w.m, t), 'entered', x, 'scale', scale, ...
                  'active', [], 'passed', [], 'touched', [], 'contacts', zeros(1, w.m.contacts));
    if w.m.final(q)
      w = ended(w, 'final', sprintf('entered mode %s at t = %.10g', w.m.mode_names{q}, t));
      return
    end
    if any(cellfun(@(v) isequal(v, [q; x]), visited))
      w = ended(w, 'zeno', sprintf('transitions on entry return to the same state at t = %.10g', t));
      return
    end
    visited{end + 1} = [q; x];
    d = data_of(w, here);
    values = w.m.surfaces{q}(t, x, w.p, d);
    then = values;
    if ~isempty(arrival.reset_at)
      then = w.m.surfaces{q}(arrival.reset_at, x, w.p, w.m.data(segment(w.m, arrival.reset_at), :));
    end
    edges = numel(w.m.edge_target{q});
    here.active = false(size(values));
    here.passed = false(size(values));
    beyond = [];
    for k = 1:numel(values)
      noise = roundoff(w, q, k, t, x, d, scale);
      if ~isempty(arrival.stood)
        noise = max(noise, abs(arrival.stood(k)));
      end
      if arrival.since > 0 && abs(values(k)) > noise
        noise = max(noise, abs(w.m.rate{q}{k}(t, x, w.p, d)) * arrival.since);
      end
      if values(k) > noise && ~(then(k) > noise)
        here.active(k) = true;
        here.passed(k) = w.m.rate{q}{k}(t, x, w.p, d) < 0;
      elseif values(k) > noise || (any(arrival.inside == k) && values(k) >= -noise)
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
    w = limited(w, t);
    if isempty(w.stop)
      [w, after, scale] = reset(w, here, k, t, x, max(abs(x), scale));
    end
    if ~isempty(w.stop)
      return
    end
    w = record(w, q, k, t, t, x, after, true);
    q = w.m.edge_target{q}(k);
    x = after;
    arrival = arrival_of(arrival.since, []);
  end
end

function [w, after, scale] = reset(w, here, k, t, x, sizes)
% The state after a transition, and the sizes of the numbers that it was computed from.
  q = here.owner;
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
  n = w.m.queues{q};
  if w.m.edge_target{q}(k) == q && any(x(n) >= 1 & after(n) > x(n))
    w = ended(w, 'waiting_limit', sprintf('two executions of an event wait at t = %.10g, and one can', t));
  end
  if ~all(isfinite(after))
    w = ended(w, 'not_finite', sprintf('the reset of %s has no value at t = %.10g', w.m.edge_names{q}{k}, t));
  end
end

function w = record(w, q, k, t, resumed, x, after, entry)
% Write one transition down.
  target = w.m.edge_target{q}(k);
  if numel(w.made) == 128
    w.earlier{end + 1} = w.made;
    w.made = w.made([]);
  end
  w.count = w.count + 1;
  w.last(end + 1) = struct('time', t, 'resumed', resumed, 'q', q, 'k', k, 'target', target, 'entry', entry);
  w.last = w.last(max(1, end - 15):end);
  w.made(end + 1) = struct('time', t, 'resumed', resumed, 'edge', w.m.edge_names{q}{k}, ...
                           'source', w.m.mode_names{q}, 'target', w.m.mode_names{target}, ...
                           'before', x, 'after', after, 'entry', entry);
end

function w = limited(w, t)
% End a run that has made as many transitions as it may.
  if w.count >= w.s.max_transitions
    w = ended(w, 'transition_limit', sprintf('%d transitions at t = %.10g', w.count, t));
  end
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

function d = data_of(w, here)
% The numbers that routines take: of a stretch of inputs, and of contacts.
  d = [w.m.data(here.k, :), here.contacts];
end

function scale = scale_of(w, here, k)
% The sizes that round-off of surface k counts with: where the state came in on it, and of pushes on guards.
  scale = here.scale;
  contact = releases(w, here, k);
  if contact > 0 && here.contacts(contact) > 0
    scale = sizes_here(w, here);
  elseif ~here.active(k)
    scale = 0 * scale;
  end
end

function sizes = sizes_here(w, here)
% The sizes that states have had, or those of the numbers that they were computed from on entry.
  sizes = max(w.sizes(w.m.state_index{here.q}), here.scale);
end

function contact = releases(w, here, k)
% The contact that surface k ends, 0 for none.
  contact = 0;
  if k <= numel(w.m.edge_releases{here.q})
    contact = w.m.edge_releases{here.q}(k);
  end
end

function yes = lets_go(w, here, k)
% Whether surface k ends a contact that holds the state.
  contact = releases(w, here, k);
  yes = contact > 0 && here.contacts(contact) == 2;
end

function here = leave(w, here, d)
% Forget the surfaces that the state was on and has left.
  for k = find(here.active(:) | here.passed(:)).'
    r = w.m.surfaces{here.q}(here.t, here.x, w.p, d);
    if abs(r(k)) > roundoff(w, here.q, k, here.t, here.x, d, scale_of(w, here, k))
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
  d = data_of(w, here);
  found = [];
  values = w.m.surfaces{q}(t, x, w.p, d);
  for k = 1:numel(w.m.edge_target{q})
    rate = w.m.rate{q}{k}(t, x, w.p, d);
    near = max(roundoff(w, q, k, t, x, d, scale_of(w, here, k)), rate * since);
    if abs(values(k)) <= near && rate > 0 && ~lets_go(w, here, k) && points_out(w, q, k, t, x, rate, d) ...
       && holds(w, q, k, t, x, d)
      found(end + 1) = k;
    end
  end
end

function yes = points_out(w, q, k, t, x, rate, d)
% Whether the flow points out of surface k, beyond the round-off of its rate.
  slopes = w.m.gradient{q}{k}(t, x, w.p, d);
  yes = rate > 16 * eps * (abs(slopes(1)) + sum(abs(slopes(2:end)) .* abs(slope(w, q, t, x, d))));
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

function event = event_of(found, best, t, x, sizes)
% A transition of the best of some edges from a point that no step has led beyond.
  event = struct('k', found(best), 't', t, 'x', x, 'depth', 0, 't1', t, 'sizes', sizes, ...
                 'tied', numel(found) > 1, 'share', 0, 'held', []);
end

function [w, here, event, done] = boundary(w, here)
% At the end of a stretch of inputs: the end of the run, or the next stretch.
  event = [];
  done = true;
  t = here.t;
  x = here.x;
  q = here.q;
  if t >= w.s.until && here.k >= numel(w.m.ends)
    relaxed = strcmp(w.s.scheme, 'relaxed');
    held = here;
    if ~relaxed
      [w, held] = contact_at(w, here);
      if ~isempty(w.stop)
        return
      end
    end
    found = on_guard(w, held, t, x, tie(t));
    if ~isempty(found)
      [unused, best] = max(w.m.edge_priority{q}(found));
      if ~relaxed
        event = event_of(found, best, t, x, sizes_along(here, x, x));
        return
      end
      w = limited(w, t);
      if ~isempty(w.stop)
        return
      end
      w = record(w, q, found(best), t, NaN, x, [], false);
    end
    w = ended(w, 'until', sprintf('reached t = %.10g', t));
    return
  end
  if w.m.jumps(segment(w.m, t))
    d = data_of(w, here);
    values = w.m.surfaces{q}(t, x, w.p, d);
    inside = [];
    for k = 1:numel(w.m.edge_target{q})
      plain = ~w.m.edge_conditional{q}(k);
      if plain && values(k) < -roundoff(w, q, k, t, x, d, scale_of(w, here, k))
        inside(end + 1) = k;
      end
    end
    arrival = arrival_of(0, []);
    arrival.inside = inside;
    arrival.stood = values .* (here.active & ~here.passed);
    [w, here] = enter(w, q, x, t, here.scale, arrival);
  else
    here.k = segment(w.m, t);
    done = false;
  end
end

function [w, here, event] = flow_located(w, here)
% Flow until a surface is crossed, along the guards that hold the state until they let go of it.
  event = [];
  w = seen(w, here.q, here.x);
  while isempty(w.stop)
    if here.t >= w.m.ends(here.k)
      [w, here, event, done] = boundary(w, here);
      if done
        return
      end
      continue
    end
    [w, held] = contact_at(w, here);
    done = false;
    while isempty(w.stop) && ~done
      [w, held, event] = follow(w, held);
      if isempty(w.stop)
        [w, here, held, event, done] = let_go(w, here, held, event);
      end
    end
    if ~isempty(event)
      return
    end
  end
end

function [w, here, event] = follow(w, here)
% Step until a surface is crossed, or the stretch of inputs ends.
  event = [];
  limit = w.m.ends(here.k);
  while here.t < limit
    q = here.q;
    d = data_of(w, here);
    t = here.t;
    x = here.x;
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
          event = event_of(found, best, t, x, sizes_along(here, x, x));
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
      here = leave(w, here, d);
    else
      if event.t > t
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
    noise = roundoff(w, q, k, t + h, z, d, scale_of(w, here, k));
    first_noise = roundoff(w, q, k, t, x, d, scale_of(w, here, k));
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
      if k > edges || holds(w, q, k, t + share * h, y, d) || (here.active(k) && holds_next(w, here, k, t + share * h, y))
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
  free = arrayfun(@(k) ~lets_go(w, here, k), fires);
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
  if stands(w, here, k, time, y, d)
    sizes = max(sizes, here.scale);
  end
  if ~isempty(here.touched)
    sizes = max(sizes, w.sizes(w.m.state_index{q}));
  end
  event = struct('k', k, 't', time, 'x', y, 'depth', 0, 't1', time, 'sizes', sizes, ...
                 'tied', sum(free) > 1, 'share', share, 'held', []);
end

function yes = stands(w, here, k, t, x, d)
% Whether a state is on a surface that it was on where it came from, or guards hold it.
  yes = ~isempty(here.touched) || here.active(k);
  values = w.m.surfaces{here.q}(t, x, w.p, d);
  for i = find(here.active(:)).'
    yes = yes || abs(values(i)) <= roundoff(w, here.q, i, t, x, d, here.scale);
  end
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
  inward = a == 0 && abs(low) <= noise && w.m.rate{q}{k}(t, x, w.p, d) < 0;
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
  if share == 0
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
  w = limited(w, event.t);
  if ~isempty(w.stop)
    return
  end
  target = w.m.edge_target{q}(k);
  resumed = event.t;
  if relaxed
    resumed = event.t1 + (w.s.relaxation - event.depth);
  elseif crowded(w, here, event)
    resumed = event.t + w.s.relaxation;
  end
  if resumed > event.t && resumed > w.s.until + tie(w.s.until)
    w = record(w, q, k, event.t, NaN, event.x, [], false);
    w = row(w, w.s.until, q, event.x);
    w = ended(w, 'until', sprintf('reached t = %.10g in the strip of %s', w.s.until, w.m.edge_names{q}{k}));
    return
  end
  [w, after, scale] = reset(w, here, k, event.t, event.x, max(abs(event.x), event.sizes));
  if ~isempty(w.stop)
    return
  end
  if resumed > event.t
    resumed = min(resumed, w.s.until);
    w = row(w, resumed, q, event.x);
  end
  flowed = has_flowed(w, event.t);
  arrival = arrival_of(0, event.t);
  if ~relaxed
    arrival = arrival_of(tie(event.t) * (event.tied || same_instant(w, event.t)), []);
    if resumed > event.t
      arrival.reset_at = event.t;
    end
    arrival.stood = still_on(w, here, event, target);
  end
  w = record(w, q, k, event.t, resumed, event.x, after, false);
  [w, here] = enter(w, target, after, resumed, scale, arrival);
  if ~isempty(w.stop)
    return
  end
  [w, returned] = returns(w, flowed, here);
  if returned && ~(relaxed && (here.q == q || taken_back(w, q, event, here)))
    w = ended(w, 'zeno', sprintf('transitions return to the same state at t = %.10g: sliding', event.t));
  elseif ~relaxed
    [w, here] = close_tail(w, here, k);
  end
end

function stood = still_on(w, here, event, target)
% How far off surfaces a transition's state is, of those that hold it or that it was on with no flow since.
  stood = [];
  if target ~= here.q
    return
  end
  stood = w.m.surfaces{here.q}(event.t, event.x, w.p, data_of(w, here));
  on = false(size(stood));
  if event.share == 0
    on = here.active;
  end
  on(event.held) = true;
  stood = stood .* on;
end

function yes = has_flowed(w, t)
% Whether the run has flowed between its last transition and a time.
  yes = isempty(w.last) || isnan(w.last(end).resumed) || t > w.last(end).resumed;
end

function yes = same_instant(w, t)
% Whether the transition before this one was made at the same instant.
  yes = ~isempty(w.last) && t - w.last(end).resumed <= tie(t);
end

function [w, yes] = returns(w, flowed, here)
% Count a transition that led to a state; say whether one of the same cascade has led there before (Brent's algorithm).
  state = [here.q; here.x];
  yes = false;
  c = w.cascade;
  if flowed || isempty(c.reference)
    w.cascade = struct('reference', state, 'length', 0, 'room', 1);
    return
  end
  yes = isequal(state, c.reference);
  c.length = c.length + 1;
  if c.length == c.room
    c = struct('reference', state, 'length', 0, 'room', 2 * c.room);
  end
  w.cascade = c;
end

function yes = taken_back(w, q, event, here)
% Whether the flows of two modes undo each other.
  one = slope(w, q, event.t, event.x, w.m.data(segment(w.m, event.t), :));
  other = slope(w, here.q, here.t, here.x, data_of(w, here));
  yes = false;
  if numel(one) ~= numel(other) || ~any(one)
    return
  end
  first = find(one, 1);
  share = other(first) / one(first);
  yes = share < 0 && all(abs(other - share * one) <= 1e-6 * abs(share) * abs(one));
end

function [yes, flight, ratio] = contraction(last)
% Whether the last few flights of the last edge, which leads back to its mode, shrink; others there may go meanwhile.
  yes = false;
  flight = 0;
  ratio = 0;
  times = [];
  for i = numel(last):-1:1
    one = last(i);
    if one.q ~= last(end).q || one.q ~= one.target || one.entry || numel(times) > 3
      break
    end
    if one.k == last(end).k
      times(end + 1) = one.time;
    end
  end
  flights = fliplr(-diff(times));
  if numel(flights) >= 3 && all(flights > 0)
    flight = flights(end);
    ratio = max(flights(2:end) ./ flights(1:end - 1));
    yes = ratio < 1;
  end
end

function left_over = flown(last, t)
% The time of flow since the first of some transitions, without that in strips.
  left_over = t - last(1).time;
  for one = last
    if ~isnan(one.resumed)
      left_over = left_over - (one.resumed - one.time);
    end
  end
end

function edges = of_contacts(w, q)
% The edges of the last transitions, where each leads back to mode q and its guard can hold a state; else none.
  edges = unique([w.last.k]);
  own = [w.last.q] == q & [w.last.target] == q & ~[w.last.entry];
  if ~all(own) || any(w.m.edge_contact{q}(edges) == 0)
    edges = [];
  end
end

function yes = crowded(w, here, event)
% Whether as many transitions as cost no time fell within the relaxation of flow, and run to no limit. Those of one
% instant count only where the edge is one of theirs; those of contacts that move the state run to a limit.
  yes = false;
  last = w.last;
  t = event.t;
  q = here.q;
  if numel(last) < 16 || contraction(last) || flown(last, t) > w.s.relaxation
    return
  end
  again = any([last.k] == event.k & [last.q] == q);
  if ~again && t - last(1).time <= tie(t)
    return
  end
  contact = w.m.edge_contact{q}(event.k) > 0;
  yes = ~(contact && ~isempty(of_contacts(w, q)) && ~keeps(w, here, event.k, t, event.x));
end

function [edges, left_over] = nearly_over(w, here, k)
% The edges of a tail that ends within the relaxation, and a bound of what is left of it; none else.
  edges = [];
  [shrinks, flight, ratio] = contraction(w.last);
  if shrinks
    left_over = flight * ratio / (1 - ratio);
    if left_over <= w.s.relaxation
      edges = k;
    end
    return
  end
  left_over = flown(w.last, here.t);
  if numel(w.last) == 16 && left_over <= w.s.relaxation
    edges = of_contacts(w, here.q);
    edges = edges(1:end * (numel(edges) > 1));
  end
end

function [w, here] = close_tail(w, here, k)
% Go to the limit of a tail that is nearly over; stop at one where no motion along the guard goes on.
  q = here.q;
  if w.last(end).q ~= q || w.last(end).target ~= q
    return
  end
  [edges, left_over] = nearly_over(w, here, k);
  time = min(here.t + left_over, w.m.ends(here.k));
  instant = numel(edges) > 1 && time == here.t;
  if isempty(edges) || ~(time > here.t || instant)
    return
  end
  [w, held] = contact_at(w, here);
  if ~isempty(w.stop) || all(ismember(edges, held.touched))
    return
  end
  x = limit_of(w, here, held.touched, edges, time);
  if ~isempty(x) && meets_another(w, here, time, x, edges)
    time = here.t;
    x = limit_of(w, here, held.touched, edges, time);
  end
  if isempty(x) || ~all(arrayfun(@(j) keeps(w, here, j, time, x), edges))
    return
  end
  if w.m.edge_contact{q}(k) == 0
    if is_possible(w, here, k, time, x, held.touched)
      w = ended(w, 'zeno', sprintf('transitions of %s accumulate at t = %.10g', w.m.edge_names{q}{k}, time));
    end
    return
  end
  both = union(held.touched(:).', edges);
  if ~isequal(keeping(w, here, edges, time, x), edges) || meets_another(w, here, time, x, edges)
    return
  end
  if ~instant && isempty(intersect(edges, pressing(w, here, keeping(w, here, both, time, x), time, x)))
    return
  end
  w = row(w, time, q, x);
  w = seen(w, q, x);
  here.t = time;
  here.x = x;
  here.entered = x;
  values = w.m.surfaces{q}(time, x, w.p, data_of(w, here));
  for i = 1:numel(values)
    here.active(i) = abs(values(i)) <= roundoff(w, q, i, time, x, data_of(w, here), here.scale) || any(edges == i);
  end
  here.passed(:) = false;
end

function x = limit_of(w, here, touched, edges, time)
% The point that a tail runs to: kept by resets, moved along the guards to its end, and kept by resets there.
  q = here.q;
  d = data_of(w, here);
  along_guards = w.m.edge_contact{q}(edges(1)) > 0;
  x = [];
  if along_guards && ~is_near(w, here, edges)
    return
  end
  y = in_turn(@(k, x) fixed_point(w, here, k, here.t, x), edges, here.x);
  if along_guards
    both = union(touched(:).', edges);
    h = time - here.t;
    one = flow_along(w, here, both, here.t, y);
    two = flow_along(w, here, both, time, y + h * one);
    y = in_turn(@(k, x) onto_guard(w, here, k, time, x), edges, y + h * (one + two) / 2);
  end
  y = in_turn(@(k, x) fixed_point(w, here, k, time, x), edges, y);
  values = w.m.surfaces{q}(time, y, w.p, d);
  if all(arrayfun(@(k) abs(values(k)) <= roundoff(w, q, k, time, y, d, here.scale), edges))
    x = y;
  end
end

function yes = is_near(w, here, edges)
% Whether what edges take back, of their guards or of the rates of these, is no more than pushes make in the relaxation.
  values = w.m.surfaces{here.q}(here.t, here.x, w.p, data_of(w, here));
  there = looked(w, here, [], edges);
  sizes = w.m.magnitudes{there.q}(here.t, here.x, w.p, data_of(w, there));
  yes = true;
  for k = edges
    last = values(k);
    if w.m.edge_order{here.q}(k) ~= 1
      last = w.m.rate{here.q}{k}(here.t, here.x, w.p, data_of(w, here));
    end
    yes = yes && abs(last) <= w.s.relaxation * sizes(k);
  end
end

function yes = meets_another(w, here, time, x, edges)
% Whether a surface other than those of edges is passed on the way to a limit.
  q = here.q;
  d = data_of(w, here);
  before = w.m.surfaces{q}(here.t, here.x, w.p, d);
  after = w.m.surfaces{q}(time, x, w.p, d);
  yes = false;
  for k = setdiff(find(after(:) > 0).', edges)
    scale = scale_of(w, here, k);
    yes = yes || (after(k) > roundoff(w, q, k, time, x, d, scale) && ...
                  ~(before(k) > roundoff(w, q, k, here.t, here.x, d, scale)));
  end
end

function x = in_turn(taken, edges, x)
% The point that a state runs to which several edges, in turn, take to what one of them keeps.
  if numel(edges) == 1
    x = taken(edges, x);
  elseif ~isempty(edges)
    x = limit(@(x) one_after_another(taken, edges, x), x);
  end
end

function x = one_after_another(taken, edges, x)
  for k = edges(:).'
    x = taken(k, x);
  end
end

function x = fixed_point(w, here, k, t, x)
% The point that repeated resets run to.
  x = limit(@(x) reset_but_counts(w, here, k, t, x), x);
end

function x = limit(step, x)
% The point that repeated steps run to: by Aitken's acceleration of each state, if the step after it is shorter.
  for round = 1:60
    one = step(x);
    if isequal(one, x)
      return
    end
    two = step(one);
    bend = two - 2 * one + x;
    leap = two;
    slow = bend ~= 0 & abs(two - one) <= abs(one - x) & abs(two - one) <= 16 * abs(bend);
    leap(slow) = x(slow) - (one(slow) - x(slow)) ./ bend(slow) .* (one(slow) - x(slow));
    after = step(leap);
    x = two;
    if all(abs(after - leap) <= abs(two - one))
      x = after;
    end
    x(abs(x) <= 2 ^ -960) = 0;
  end
end

function x = onto_guard(w, here, k, t, x)
% A point near a guard taken to it, as near as numbers are, each state in proportion to its scale.
  q = here.q;
  d = data_of(w, here);
  values = w.m.surfaces{q}(t, x, w.p, d);
  scales = sizes_here(w, here);
  for round = 1:4
    slopes = w.m.gradient{q}{k}(t, x, w.p, d);
    weights = slopes(2:end) .* scales .^ 2;
    across = slopes(2:end).' * weights;
    if ~(across > 0)
      return
    end
    nearer = x - values(k) / across * weights;
    left_over = w.m.surfaces{q}(t, nearer, w.p, d);
    if ~(abs(left_over(k)) < abs(values(k)))
      return
    end
    x = nearer;
    values = left_over;
  end
end

function after = reset_but_counts(w, here, k, t, x)
% What the reset of edge k makes of a state at a slow impact, but for states that it counts with.
  after = w.m.slow{here.q}{k}(t, x, w.p, data_of(w, here));
  counts = w.m.edge_counts{here.q}{k};
  after(counts) = x(counts);
end

function yes = keeps(w, here, k, t, x)
% Whether the reset of edge k leaves a state where it is.
  yes = all(abs(reset_but_counts(w, here, k, t, x) - x) <= 2 * eps * sizes_here(w, here));
end

function there = looked(w, here, holding, looked_at)
% The place with the routines of contacts, of some edges that hold the state and others that are looked at.
  there = here;
  contact = w.m.edge_contact{here.owner};
  there.q = w.m.held(here.owner);
  there.contacts = zeros(1, w.m.contacts);
  places = contact(looked_at);
  there.contacts(places(places > 0)) = 1;
  places = contact(holding);
  there.contacts(places(places > 0)) = 2;
end

function f = flow_along(w, here, holding, t, x)
% The flow along the guards of some edges, the mode's own where there are none.
  there = here;
  there.q = here.owner;
  if ~isempty(holding)
    there = looked(w, here, holding, []);
  end
  f = slope(w, there.q, t, x, data_of(w, there));
end

function [w, held] = contact_at(w, here)
% The place in contact with the guards that hold the state; a stop where these have no one motion.
  held = here;
  if ~any(here.active) || w.m.held(here.q) == 0
    return
  end
  kept = keeping(w, here, find(here.active(:)).', here.t, here.x);
  [holding, one] = pressing(w, here, kept, here.t, here.x);
  if ~one || (numel(holding) > 1 && any(isnan(flow_along(w, here, holding, here.t, here.x))))
    w = ended(w, 'zeno', sprintf('guards have no one motion along them at t = %.10g', here.t));
  elseif ~isempty(holding)
    held = looked(w, here, holding, []);
    held.touched = holding;
    active = here.active;
    active(holding) = false;
    edges = numel(w.m.edge_target{here.q});
    ends = numel(w.m.edge_target{held.q}) - edges;
    held.active = [active(1:edges); false(ends, 1); active(edges + 1:end)];
    held.passed = false(size(held.active));
  end
end

function kept = keeping(w, here, surfaces, t, x)
% The edges of some surfaces whose guards hold the state where the flow presses on them: resets keep it there.
  kept = [];
  q = here.q;
  d = data_of(w, here);
  for k = surfaces(surfaces <= numel(w.m.edge_target{q}))
    if w.m.edge_contact{q}(k) == 0 || ~keeps(w, here, k, t, x)
      continue
    end
    if w.m.edge_order{q}(k) == 2
      sizes = abs(slope(w, q, t, x, d)) + abs(w.m.jacobian{q}(t, x, w.p, d)) * sizes_here(w, here);
      slopes = w.m.gradient{q}{k}(t, x, w.p, d);
      size_of = abs(slopes(1)) + abs(slopes(2:end)).' * sizes;
      if ~(abs(w.m.rate{q}{k}(t, x, w.p, d)) <= 8 * eps * size_of)
        continue
      end
    end
    kept(end + 1) = k;
  end
end

function [holding, one] = pressing(w, here, kept, t, x)
% Those of some guards that hold the state together; whether that is one choice.
  holding = kept;
  one = true;
  if isempty(kept)
    return
  end
  for round = 1:numel(kept) + 2
    before = holding;
    [holding, one] = pushes(w, here, holding, kept, t, x);
    if ~one || isequal(holding, before) || numel(kept) == 1
      return
    end
  end
  one = false;
  holding = [];
end

function [pushed, has] = pushes(w, here, holding, kept, t, x)
% Those of some guards that the flow presses on while those ``holding`` hold it; whether it has a value there.
  there = looked(w, here, holding, kept);
  d = data_of(w, there);
  r = w.m.surfaces{there.q}(t, x, w.p, d);
  has = ~any(isnan(r(kept)));
  pushed = [];
  none = looked(w, here, [], kept);
  for k = kept(has(ones(size(kept))))
    noise = roundoff(w, there.q, k, t, x, d, sizes_here(w, here));
    presses = r(k) < -noise || (r(k) <= noise && ~lifts_next(w, there, k));
    if presses && (holds(w, none.q, k, t, x, data_of(w, none)) || is_possible(w, here, k, t, x, holding))
      pushed(end + 1) = k;
    end
  end
end

function yes = lifts_next(w, there, k)
% Whether the push on a guard, zero now, is first negative where the flow makes it differ from zero.
  yes = false;
  d = data_of(w, there);
  t = there.t;
  x = there.x;
  after = eps / 2 * w.s.until;
  while there.t + after < w.m.ends(there.k)
    time = there.t + after;
    x = x + (time - t) * slope(w, there.q, t, x, d);
    t = time;
    r = w.m.surfaces{there.q}(t, x, w.p, d);
    if abs(r(k)) > roundoff(w, there.q, k, t, x, d, sizes_here(w, there))
      yes = r(k) > 0;
      return
    end
    after = after * 16;
  end
end

function yes = is_possible(w, here, k, t, x, touched)
% Whether the `if` of edge k holds at a point, or next along the flow that the guards of other edges leave.
  here.contacts(:) = 0;
  d = data_of(w, here);
  yes = holds(w, here.owner, k, t, x, d) || holds(w, here.owner, k, t, pressed(w, here, k, t, x, touched), d);
end

function x = pressed(w, here, k, t, x, touched)
% Where the flow presses a state, by what the guard of edge k takes away of the flow that others' guards leave.
  others = setdiff(touched(:).', k);
  f = flow_along(w, here, others, t, x);
  if w.m.edge_contact{here.owner}(k) > 0
    f = f - flow_along(w, here, union(others, k), t, x);
  end
  moved = w.m.edge_changes{here.owner}{k};
  moved = moved(f(moved) ~= 0);
  sizes = sizes_here(w, here);
  after = max([0; 8 * eps * reshape(sizes(moved) ./ abs(f(moved)), [], 1)]);
  if after == 0 % these states have been zero only
    after = eps / 2 * w.s.until;
  end
  x = x + after * f;
end

function yes = holds_next(w, here, k, t, x)
% Whether the `if` of an edge that leads back, of a surface that the state is on, holds next along the flow.
  yes = k <= numel(w.m.edge_contact{here.owner}) && w.m.edge_target{here.owner}(k) == here.owner ...
        && is_possible(w, here, k, t, x, []);
end

function [w, here, held, event, done] = let_go(w, here, held, event)
% Leave the guards that hold a state where a stretch of inputs or an event ends that; others events are transitions.
  done = true;
  if isempty(held.touched)
    here = held;
    return
  end
  if isempty(event)
    here = held_exactly(w, here, held, held.t, held.x, []);
    return
  end
  if ~lets_go(w, held, event.k)
    event.held = held.touched;
    after = held_exactly(w, here, held, event.t, event.x, event.k);
    event.x = after.x;
    return
  end
  own = event.k <= numel(w.m.edge_target{here.q});
  t = event.t;
  x = event.x;
  frees = true;
  if ~own
    [t, x, frees] = behind_end(w, held, event.k, t, x);
  end
  if t > event.t
    w = row(w, t, held.q, x);
  end
  held.t = t;
  held.x = x;
  held = leave(w, held, data_of(w, held));
  done = frees;
  if frees
    began = here.t;
    here = held_exactly(w, here, held, t, x, []);
    if t == began && own % to round-off it neither holds the state nor lets go
      here.active(event.k) = false;
    end
    here.scale = event.sizes;
    here.entered = here.x;
  end
  event = [];
end

function here = held_exactly(w, here, held, t, x, reached)
% The mode itself again, the state without what steps along its guards were off by: they may hold it again.
  edges = numel(w.m.edge_target{here.q});
  ends = numel(w.m.edge_target{held.q}) - edges;
  kept = held.active;
  for k = find(kept(:)).'
    kept(k) = ~lets_go(w, held, k);
  end
  here.active = [kept(1:edges); kept(edges + ends + 1:end)];
  here.active(held.touched) = true;
  here.passed(:) = false;
  here.t = t;
  here.x = x;
  y = in_turn(@(k, x) onto_guard(w, here, k, t, x), union(held.touched(:).', reached), x);
  y = in_turn(@(k, x) fixed_point(w, here, k, t, x), held.touched, y);
  if all(arrayfun(@(k) keeps(w, here, k, t, y), held.touched))
    here.x = y;
  end
end

function [time, x, ends] = behind_end(w, held, k, t, x0)
% A point behind the end of a part of an `if` in contact, and whether an `if` does not hold there.
  d = data_of(w, held);
  contact = w.m.edge_contact{held.owner};
  own = held.touched(find(contact(held.touched) == w.m.edge_releases{held.q}(k), 1));
  after = eps / 2 * w.s.until;
  most = sqrt(eps / 2) * w.s.until;
  f = slope(w, held.q, t, x0, d);
  while true
    time = min(t + after, w.m.ends(held.k));
    x = x0 + (time - t) * f;
    ends = ~all(arrayfun(@(j) is_possible(w, held, j, time, x, held.touched), held.touched));
    r = w.m.surfaces{held.q}(time, pressed(w, held, own, time, x, held.touched), w.p, d);
    above = r(k) > roundoff(w, held.q, k, time, x, d, sizes_here(w, held));
    if ends || above || ~(after < most && time < w.m.ends(held.k))
      return
    end
    after = after * 2;
  end
end

function sizes = start_sizes(w, q, x)
% The sizes that the flow gives the states within the run, from a start in a mode with motion along guards.
  sizes = 0 * x;
  if w.m.held(q) == 0
    return
  end
  d = w.m.data(segment(w.m, 0), :);
  f = slope(w, q, 0, x, d);
  J = w.m.jacobian{q}(0, x, w.p, d);
  time = w.s.until / (1 + w.s.until * sqrt(max([0; sum(abs(J) .* abs(J).', 2)])));
  first = max(abs(x), time * abs(f));
  found = max(first, time * (abs(J) * first));
  if all(isfinite(found))
    sizes = found;
  end
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
    d = data_of(w, here);
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
    here = leave(w, here, d);
  end
end

function [w, event] = stuck(w, here, wall)
% No step, however short, stays in the relaxed domain: take a guard that the state is on, or stop.
  event = [];
  found = on_guard(w, here, here.t, here.x, tie(here.t));
  if ~isempty(found)
    [unused, best] = max(w.m.edge_priority{here.q}(found));
    event = event_of(found, best, here.t, here.x, strip_sizes(here, here.x, here.x, found(best)));
  elseif wall > 0
    w = left(w, here.q, wall, here.t);
  else
    d = data_of(w, here);
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
    noise(k) = roundoff(w, q, k, t1, z, d, scale_of(w, here, k));
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
    if free && start(k) > roundoff(w, q, k, t, x, d, scale_of(w, here, k))
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
  if ~holds(w, q, k, time, y, d) && ~(on && holds_after(w, here, k, t, h, x, C, share, value, d))
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

function yes = holds_after(w, here, k, t, h, x, C, share, value, d)
% Whether the `if` of an edge holds where a hop ends that round-off hides, or next.
  back = -w.m.rate{here.q}{k}(t + share * h, along(x, C, share), w.p, d) * h;
  if back > 0
    share = share + (1 - share) * (back / (back + value));
  end
  yes = holds_next(w, here, k, t + share * h, along(x, C, share));
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
