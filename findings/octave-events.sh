#!/usr/bin/env bash
# What the `Events` of ode45 and ode23 do in GNU Octave 7.3 (Debian 12), which its manual does not say:
#
# - Time and state of an event are on the chord of the step in which it lies. So its error depends on the length of the
#   step and not on RelTol: a ball hits the floor 1 to 8 ms early at every tolerance from 1e-3 to 1e-12.
# - A terminal event in the first step of a call does not end the run: it goes on beyond the guard.
# - Of two events in one step, the first of the list is reported, not the earlier one.
#
# A small MaxStep mends the first and the last, a small InitialStep the second. Exits with 0 while this is so.
set -euo pipefail
command -v octave-cli > /dev/null || apt-get install --yes --no-install-recommends octave > /dev/null
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
cat > "$folder/events.m" << 'OCTAVE'
1;
function [value, terminal, direction] = fallen(t, x)
  value = x(1); terminal = 1; direction = -1;
end
function [value, terminal, direction] = reached(t, x, levels)
  value = x(1) - levels(:); terminal = direction = ones(numel(levels), 1);
end
function [ends, found] = levels_of(levels, first)
  options = odeset('Events', @(t, x) reached(t, x, levels), 'InitialStep', first, 'MaxStep', 1);
  [t, x, found] = ode45(@(t, x) 1, [0 3], 0, options);
  ends = t(end);
end
function holds = show(sentence, holds)
  words = {'NO ', 'yes'};
  printf('%s %s\n', words{holds + 1}, sentence);
end
warning('off', 'all');
printf('GNU Octave %s: when a ball from a height of 10 hits, less the exact time\n', version);
errors = [];
for maximum = [Inf 1e-2 1e-3]
  for solver = {'ode45', 'ode23'}
    row = [];
    for tolerance = [1e-3 1e-6 1e-9 1e-12]
      options = odeset('RelTol', tolerance, 'AbsTol', tolerance, 'Events', @fallen);
      if isfinite(maximum) options = odeset(options, 'MaxStep', maximum); end
      [t, x, time] = feval(solver{1}, @(t, x) [x(2); -9.81], [0 3], [10; 0], options);
      row(end + 1) = time(1) - sqrt(20/9.81);
    end
    printf('%s, MaxStep %-5g RelTol 1e-3, 1e-6, 1e-9, 1e-12:%s\n', solver{1}, maximum, sprintf(' %9.1e', row));
    errors(end + 1, :) = row;
  end
end
[end_first, found_first] = levels_of(0.5, 1);
[end_second, found_second] = levels_of(0.5, 0.1);
[~, both] = levels_of([1.9; 1.2], 1);
seen = [
  show('at every tolerance a ball hits 1 to 8 ms early', all(all(errors(1:2, :) < -9e-4 & errors(1:2, :) > -9e-3)));
  show('with MaxStep 1e-2 within 1e-5, with 1e-3 within 1e-7',
       all(all(abs(errors(3:4, :)) < 1e-5)) && all(all(abs(errors(5:6, :)) < 1e-7)));
  show('a terminal event in the first step is found and does not end the run', end_first == 3 && abs(found_first - 0.5) < 1e-9);
  show('in a later step it ends the run', abs(end_second - 0.5) < 1e-9);
  show('of 1.9 and 1.2, passed in one step, the first of the list is found alone', numel(both) == 1 && abs(both - 1.9) < 1e-9);
];
exit(!all(seen));
OCTAVE
octave-cli --norc "$folder/events.m" 2> "$folder/noise" || { rc=$?; cat "$folder/noise" >&2; exit "$rc"; }
