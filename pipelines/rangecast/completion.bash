# SPDX-License-Identifier: LGPL-2.1-or-later
# Completion of rangecast's commands, options and file names for bash.

_rangecast () {
  local word=${COMP_WORDS[COMP_CWORD]} words
  if [ "$COMP_CWORD" = 1 ]; then
    words=$(rangecast --help | sed -n 's/^    \([a-z][a-z]*\)\( .*\)*$/\1/p')
  elif [[ "$word" == -* ]]; then
    words=$(rangecast "${COMP_WORDS[1]}" --help 2>/dev/null | grep -oE -- '--[a-z-]+' | sort -u)
  else
    mapfile -t COMPREPLY < <(compgen -f -- "$word")
    return
  fi
  mapfile -t COMPREPLY < <(compgen -W "$words" -- "$word")
}
complete -o filenames -F _rangecast rangecast
