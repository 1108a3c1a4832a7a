// Choices that survive a reload: this browser's, for each page address.

/** The kept choice; undefined when there is none or the browser keeps nothing. */
export function kept(name: string): unknown {
  try {
    return JSON.parse(localStorage.getItem(`dtact ${name}`) ?? "null") ?? undefined;
  } catch {
    return undefined;
  }
}

export function keep(name: string, choice: unknown): void {
  try {
    localStorage.setItem(`dtact ${name}`, JSON.stringify(choice));
  } catch {
    // A browser without storage forgets the choice, and works otherwise.
  }
}
