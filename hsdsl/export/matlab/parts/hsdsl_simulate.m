function r = hsdsl_simulate(m, p, x0, s)
% r = hsdsl_simulate(m, p, x0, s)  Follow a hybrid system from x0 at t = 0, by the loop of hsdsl.
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
%
% The first call compiles the program in the folder c: to a MEX file, or where that fails to a program that is called.
  if nargin < 4
    s = m.settings;
  end
  out = called(m, numbers_of(m, p, x0(:), s));
  width = out(5);
  rows = reshape(out(6:5 + out(3) * (3 + width)), 3 + width, []).';
  made = reshape(out(6 + numel(rows):end), 5 + 2 * width, []);
  words = {'until', 'final', 'left_domain', 'zeno', 'transition_limit', 'waiting_limit', 'not_finite', ...
           'step_underflow', 'interrupted'};
  stop = words{out(1) + 1};
  r = struct('t', rows(:, 1), 'j', rows(:, 2), 'x', rows(:, 3:end), 'transitions', transitions(m, made, width), ...
             'stop', stop, 'about', about(m, stop, out(2), rows(end, 3), rows(end, 4:end)));
end

function given = numbers_of(m, p, x0, s)
% What the program takes, checked.
  if s.tolerance > 0
    largest = m.largest_share * s.until;
    step = largest / 100;
  else
    step = s.step;
    largest = step;
  end
  q = x0(1);
  check(any(q == 1:numel(m.dim)), 'mode', sprintf('expected a mode from 1 to %d, got %g', numel(m.dim), q));
  check(numel(x0) <= m.width + 1 && numel(x0) > m.dim(q), 'initial', ...
        sprintf('expected %d states of mode %s, got %d', m.dim(q), m.mode_names{q}, numel(x0) - 1));
  check(any(strcmp(s.scheme, {'relaxed', 'located'})), 'scheme', ...
        sprintf('expected the scheme relaxed or located, got %s', s.scheme));
  check((s.tolerance > 0) == (s.step <= 0) && (s.tolerance <= 0 || m.adaptive), 'step', ...
        'expected a step or, of an adaptive method, a tolerance; the other is 0');
  check(s.until >= 0 && s.until < Inf && (s.until <= m.settings.until || ~m.fixed_until), 'until', ...
        sprintf('expected an end up to that of the export, %g, until which inputs are known, got %g', ...
                m.settings.until, s.until));
  x = zeros(m.width, 1);
  x(1:numel(x0) - 1) = x0(2:end);
  values = cellfun(@(field) double(p.(field)), m.parameters);
  given = [strcmp(s.scheme, 'located'); step; s.tolerance; largest; s.relaxation; s.until; s.max_transitions; q; ...
           x; values(:)];
  check(all(isfinite(given)) && s.relaxation > 0, 'numbers', 'expected finite numbers and a positive relaxation');
end

function check(kept, what, message)
  if ~kept
    error(['hsdsl:' what], '%s', message);
  end
end

function made = transitions(m, rows, width)
% The transitions as structures: a row of numbers each.
  made = struct('time', {}, 'resumed', {}, 'edge', {}, 'source', {}, 'target', {}, 'before', {}, 'after', {}, ...
                'entry', {});
  for i = size(rows, 2):-1:1
    row = rows(:, i);
    q = row(3);
    k = row(4);
    target = m.edge_target{q}(k);
    before = row(6:5 + m.dim(q));
    after = row(6 + width:5 + width + m.edge_states{q}(k));
    made(i) = struct('time', row(1), 'resumed', row(2), 'edge', m.edge_names{q}{k}, ...
                     'source', mode_name(m, q, before), 'target', mode_name(m, target, after), 'before', before, ...
                     'after', after, 'entry', row(5) > 0);
  end
end

function name = mode_name(m, q, x)
% The name of a mode; of a system of parts that of the product mode.
  name = m.mode_names{q};
  if isempty(m.part_names)
    return
  end
  names = cell(1, numel(m.part_names));
  for k = 1:numel(names)
    number = 1;
    if m.part_number(k) > 0
      number = x(m.part_number(k));
    end
    names{k} = [m.part_names{k} '=' m.part_modes{k}{number}];
  end
  name = strjoin(names, ' ');
end

function text = about(m, stop, t, q, x)
% Why a run ended, as a sentence.
  mode = mode_name(m, q, x);
  switch stop
    case 'until'
      text = sprintf('the run ends at t = %.10g', t);
    case 'final'
      text = sprintf('entered mode %s at t = %.10g', mode, t);
    case 'left_domain'
      text = sprintf('mode %s ends at a wall, at t = %.10g', mode, t);
    case 'zeno'
      text = sprintf('transitions accumulate, or return to the same state, at t = %.10g', t);
    case 'transition_limit'
      text = sprintf('as many transitions as allowed at t = %.10g', t);
    case 'waiting_limit'
      text = sprintf('more executions of an event than can wait at t = %.10g', t);
    case 'not_finite'
      text = sprintf('something of mode %s has no finite value at t = %.10g', mode, t);
    case 'step_underflow'
      text = sprintf('no step leads on from t = %.10g in mode %s', t, mode);
    otherwise
      text = sprintf('memory is short at t = %.10g', t);
  end
end

function out = called(m, given)
% What the program answers: a MEX file that there is or can be made, else a program of its own.
  folder = fileparts(which([m.name '_model']));
  program = fullfile(folder, [m.gateway '.exe']);
  if exist(m.gateway, 'file') ~= 3 && exist(program, 'file') ~= 2
    failed = compiled_mex(m, folder);
    if ~isempty(failed)
      compiled_program(program, folder, failed);
    end
    rehash();
  end
  if exist(m.gateway, 'file') == 3
    out = feval(m.gateway, given);
    return
  end
  in = tempname();
  answer = tempname();
  file = fopen(in, 'w');
  fwrite(file, given, 'double');
  fclose(file);
  status = system(quoted({program, in, answer}));
  delete(in);
  check(status == 0, 'program', sprintf('expected %s to end with 0, got %d', program, status));
  file = fopen(answer, 'r');
  out = fread(file, Inf, 'double');
  fclose(file);
  delete(answer);
end

function [sources, flags] = ingredients(folder)
% The files that are compiled, and the flags with which every digit is that of hsdsl run.
  sources = fullfile(folder, 'c', {'gateway.c', 'model.c', 'problem.c', 'instance.c', fullfile('runtime', 'hs.c')});
  flags = '-std=c99 -O2 -DHS_NO_CLOCK @EXACT';
end

function failed = compiled_mex(m, folder)
% Compile to a MEX file; why that failed, else nothing.
  [sources, flags] = ingredients(folder);
  includes = {['-I' fullfile(folder, 'c')], ['-I' fullfile(folder, 'c', 'runtime')]};
  failed = '';
  try
    if exist('OCTAVE_VERSION', 'builtin')
      before = getenv('CFLAGS');
      setenv('CFLAGS', flags);
      target = fullfile(folder, [m.gateway '.mex']);
      [output, status] = mkoctfile('--mex', '-o', target, includes{:}, sources{:});
      setenv('CFLAGS', before);
      if status ~= 0
        failed = output;
      end
    else
      mex('-silent', ['CFLAGS=$CFLAGS ' flags], '-outdir', folder, '-output', m.gateway, includes{:}, sources{:});
    end
  catch reason
    failed = reason.message;
  end
end

function compiled_program(program, folder, failed)
% Compile to a program, which needs a C compiler alone.
  [sources, flags] = ingredients(folder);
  compiler = getenv('CC');
  if isempty(compiler)
    compiler = 'cc';
  end
  c = fullfile(folder, 'c');
  words = [{['-I' c], ['-I' fullfile(c, 'runtime')], '-o', program}, sources];
  [status, output] = system([compiler ' ' flags ' -DGATEWAY_PROGRAM' quoted(words) ' -lm 2>&1']);
  check(status == 0, 'compiler', ...
        sprintf('expected a C compiler for MEX files or programs: %s; %s', strtrim(failed), strtrim(output)));
end

function text = quoted(words)
% Words of a command line: none of their signs means anything.
  if ispc()
    text = sprintf(' "%s"', words{:});
  else
    words = strrep(words, '''', '''\''''');
    text = sprintf(' ''%s''', words{:});
  end
end
