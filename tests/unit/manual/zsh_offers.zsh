#!/usr/bin/zsh -f
# zsh_offers.zsh FOLDER LINE...: what zsh offers at the end of each command line, with the completions in
# FOLDER (named _PROGRAM): "LINE<tab>WORD" for each word. Completion runs in the line editor alone, and
# that on a terminal alone: an interactive zsh on one of its own.
zmodload zsh/zpty || exit 1
typeset folder=$1 offered=$(mktemp)
shift
typeset setup="
  PS1= PS2= ; unsetopt prompt_cr prompt_sp beep auto_list auto_menu; HISTFILE=
  fpath=(${(q)folder} \$fpath)
  autoload -Uz compinit && compinit -u -D
  typeset -ga lines=(${(@q)@})
  compadd() {
    # With these it fills arrays of the caller and offers nothing.
    if [[ \${@[1,(i)(-|--)]} == *-(O|A|D)\\ * ]]; then builtin compadd \"\$@\"; return; fi
    local -a hits
    builtin compadd -A hits \"\$@\"
    (( \$#hits )) && print -rl -- \"\$line_now\"\$'\\t'\$^hits >>${(q)offered}
    builtin compadd \"\$@\"
  }
  zle-line-init() {
    typeset -g line_now
    for line_now in \"\$lines[@]\"; do
      BUFFER=\$line_now CURSOR=\$#line_now
      zle complete-word
    done
    exit
  }
  zle -N zle-line-init
"
typeset script=$(mktemp)
print -r -- $setup >$script
zpty -b offers zsh -f -i
zpty -w offers "source ${(q)script}"
while zpty -t offers; do zpty -r offers >/dev/null 2>&1; sleep 0.05; done
sort -u $offered
rm -f $offered $script
