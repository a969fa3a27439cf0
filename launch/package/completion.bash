# SPDX-License-Identifier: MIT
# Bash completion of anlos.  What there is to choose from the programs say themselves in
# --help, of the value of an option in --help=OPTION, and topics in `anlos topic list`.

_anlos_topics() {
    "$1" topic list 2>/dev/null | awk 'NR > 1 { print $1 }'
}

_anlos() {
    local word=$2 before=$3 help list=
    local -a command=() choice=()

    # --format=w is three words.
    [[ $before == = ]] && before=${COMP_WORDS[COMP_CWORD - 2]}
    [[ $word == = ]] && word=

    # The command and its verb, without options.
    local i
    for ((i = 1; i < COMP_CWORD && ${#command[@]} < 2; i++)); do
        [[ ${COMP_WORDS[i]} == -* || $i:${COMP_WORDS[i]} == 1:help ]] ||
            command+=("${COMP_WORDS[i]}")
    done
    help=$("$1" "${command[@]}" --help 2>/dev/null) ||
        help=$("$1" "${command[@]::1}" --help 2>/dev/null) || return

    if [[ $word == -* ]]; then
        choice=($(grep -oE -- '^ +(-[a-z], )?--[a-z0-9-]+' <<<"$help" | grep -oE -- '--.*'))
    elif [[ $before == -* ]] &&
        grep -qE -- "^ +(-[a-z], )?$before(, --[a-z0-9-]+)? [A-Z]" <<<"$help"; then
        list=$(grep -E -- "^ +$before [A-Z]+,\.\.\." <<<"$help")
        case $before in
        --rate) choice=(max) ;; # or a number
        --topic | --topics | --exclude) choice=($(_anlos_topics "$1")) ;;
        *) choice=($("$1" "${command[@]}" --help="${before#--}" 2>/dev/null)) ;; # or a file
        esac
    elif [ ${#command[@]} -eq 2 ] && [[ "${command[*]}" =~ ^(topic\ (echo|pub|hz|bw|delay)|bag\ record)$ ]]; then
        [[ ${command[0]} == bag ]] && list=TOPICS
        choice=($(_anlos_topics "$1"))
    elif [ ${#command[@]} -lt 2 ] && grep -qE \
        "^(usage:|      ) anlos ?${command[*]} ([a-z|]+|VERB|WHAT|COMMAND)\b" <<<"$help"; then
        # Commands, or a command's verbs, stand in a list before the options.
        choice=($(sed -nE '/^  -/q; s/^  ([a-z][a-z-]*)( [A-Z]+)?  +[^ ].*/\1/p' <<<"$help"))
    fi
    # Of a list with commas only what follows the last one is completed.
    [[ $list ]] && list=${word%"${word##*,}"}
    COMPREPLY=($(compgen -P "$list" -W "${choice[*]}" -- "${word#"$list"}"))
}

complete -o bashdefault -o default -F _anlos anlos
